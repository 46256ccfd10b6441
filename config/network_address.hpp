// Where Modbus listens and who may connect, as text in a configuration.
#pragma once
#include <string>

namespace tactiled {

struct ListenAddress {
    std::string fault;  // "" where the text is good, else what would be right
    bool loopback;      // reached from this machine alone
};

// "ADDRESS:PORT", IPv4 dotted or [IPv6], port 1 .. 65535. setup
ListenAddress check_listen_address(const std::string& text);

// "ADDRESS/BITS" with no bits set beyond BITS, and BITS > 0. Returns "" or what would be right. setup
std::string fault_of_network(const std::string& text);

}  // namespace tactiled
