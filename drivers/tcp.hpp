// A TCP connection to a device: its address, and opening within bounded time.
#pragma once
#include <sys/socket.h>

#include <string>

namespace tactiled {

struct TcpAddress {
    sockaddr_storage bytes{};
    socklen_t size = 0;  // 0: `fault` has the reason
    std::string fault;
};

// Parses "192.168.1.1:502", "192.168.1.1" or "[fd00::1]:502". Host names are not accepted, because a lookup may take
// seconds. setup
TcpAddress tcp_address(const std::string& text, unsigned default_port);

// Connects within `timeout_ms`. Returns the descriptor, non-blocking, or -1 with the reason and the remedy in `why`.
int open_tcp(const TcpAddress& address, const std::string& text, int timeout_ms, std::string& why);

}  // namespace tactiled
