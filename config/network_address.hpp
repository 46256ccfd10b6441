// The address on which a server listens, and the networks of its clients, as text.
#pragma once
#include <sys/socket.h>

#include <string>

namespace tactiled {

struct ListenAddress {
    std::string fault;         // "" if the text is valid, else the expected form
    bool loopback = false;     // reachable from this machine only
    sockaddr_storage bytes{};  // for bind()
    socklen_t size = 0;
};

// Parses "ADDRESS:PORT", IPv4 dotted or [IPv6], port 1 .. 65535. setup
ListenAddress check_listen_address(const std::string& text);

// Checks "ADDRESS/BITS" with no bits set beyond BITS, and BITS > 0. Returns "" or the fault. setup
std::string fault_of_network(const std::string& text);

}  // namespace tactiled
