#include "node/modbus/allow_list.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace tactiled::modbus {
namespace {

using Address = HostAddress;

Address mapped(const in_addr& v4) noexcept {
    Address a{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF};
    std::memcpy(a.data() + 12, &v4, 4);
    return a;
}

bool same_prefix(const Address& a, const Address& b, unsigned bits) noexcept {
    const unsigned whole = bits / 8, rest = bits % 8;
    if (!std::equal(a.begin(), a.begin() + whole, b.begin())) return false;
    return rest == 0 || (a[whole] ^ b[whole]) >> (8 - rest) == 0;
}

}  // namespace

HostAddress host_of(const sockaddr_storage& peer) noexcept {
    if (peer.ss_family == AF_INET) return mapped(reinterpret_cast<const sockaddr_in&>(peer).sin_addr);
    return std::to_array(reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr.s6_addr);
}

AllowList::AllowList(const std::vector<std::string>& networks) {
    const std::vector<std::string> loopback{"127.0.0.0/8", "::1/128"};
    for (const auto& text : networks.empty() ? loopback : networks) {
        const std::size_t slash = text.find('/');
        const std::string address = text.substr(0, slash);
        in_addr v4{};
        in6_addr v6{};
        const bool is_v4 = ::inet_pton(AF_INET, address.c_str(), &v4) == 1;
        if (!is_v4 && ::inet_pton(AF_INET6, address.c_str(), &v6) != 1) continue;
        Network network{};
        network.address = is_v4 ? mapped(v4) : std::to_array(v6.s6_addr);
        const unsigned full = is_v4 ? 32 : 128;
        const unsigned bits =
            slash == std::string::npos ? full : unsigned(std::strtoul(text.c_str() + slash + 1, nullptr, 10));
        network.bits = std::min(bits, full) + (is_v4 ? 96 : 0);
        networks_.push_back(network);
    }
}

bool same_host(const sockaddr_storage& a, const sockaddr_storage& b) noexcept { return host_of(a) == host_of(b); }

bool AllowList::allows(const sockaddr_storage& peer) const noexcept {
    const Address address = host_of(peer);
    return std::any_of(networks_.begin(), networks_.end(),
                       [&](const Network& n) { return same_prefix(address, n.address, n.bits); });
}

}  // namespace tactiled::modbus
