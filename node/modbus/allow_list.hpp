// The addresses that may connect.
#pragma once
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace tactiled::modbus {

using HostAddress = std::array<std::uint8_t, 16>;  // IPv4 is stored as ::ffff:a.b.c.d
[[nodiscard]] HostAddress host_of(const sockaddr_storage& peer) noexcept;

class AllowList {
public:
    // CIDR texts that the configuration has checked; an empty list allows only the loopback.
    explicit AllowList(const std::vector<std::string>& networks);
    [[nodiscard]] bool allows(const sockaddr_storage& peer) const noexcept;

private:
    struct Network {
        HostAddress address;
        unsigned bits;
    };
    std::vector<Network> networks_;
};

// Returns true if two peers are the same host, independent of their ports.
bool same_host(const sockaddr_storage& a, const sockaddr_storage& b) noexcept;

}  // namespace tactiled::modbus
