// A TCP connection to a device: its address, and opening within bounded time.
#pragma once
#include <sys/socket.h>

#include <string>

namespace tactiled {

struct TcpAddress {
    sockaddr_storage bytes{};
    socklen_t size = 0;  // 0: `fault` says what is wrong
    std::string fault;
};

// "192.168.1.1:502", "192.168.1.1" or "[fd00::1]:502". No names: asking for one may take seconds. setup
TcpAddress tcp_address(const std::string& text, unsigned default_port);

// Connects within `timeout_ms`. Returns the descriptor, non-blocking, or -1 with `why` and its remedy.
int open_tcp(const TcpAddress& address, const std::string& text, int timeout_ms, std::string& why);

}  // namespace tactiled
