// Texts as addresses and networks. Oracles: a network that is accepted lets in exactly the addresses that have its first
// bits, looked at one by one; an address to listen at that is accepted is said to be the loopback only where it is.
#include <arpa/inet.h>

#include <array>
#include <cstring>
#include <string>

#include "config/network_address.hpp"
#include "node/modbus/allow_list.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using fuzz::check;

std::string bits_of(const void* address, std::size_t bytes) {
    std::string bits;
    for (std::size_t k = 0; k < bytes; ++k)
        for (int bit = 7; bit >= 0; --bit)
            bits += (static_cast<const std::uint8_t*>(address)[k] >> bit & 1) != 0 ? '1' : '0';
    return bits;
}

void check_network(const std::string& text, std::span<const std::uint8_t> peer) {
    if (!fault_of_network(text).empty()) return;
    const modbus::AllowList list({text});
    const std::string address = text.substr(0, text.find('/'));
    const auto n = std::size_t(std::stoul(text.substr(text.find('/') + 1)));
    sockaddr_storage other{};
    std::uint8_t network[16] = {};
    const bool v4 = ::inet_pton(AF_INET, address.c_str(), network) == 1;
    if (!v4) check(::inet_pton(AF_INET6, address.c_str(), network) == 1);
    const std::size_t size = v4 ? 4 : 16;
    check(n >= 1 && n <= 8 * size);
    std::uint8_t host[16] = {};
    std::memcpy(host, network, size);
    for (std::size_t k = 0; k < size && k < peer.size(); ++k) host[size - 1 - k] ^= peer[k];
    if (v4) {
        other.ss_family = AF_INET;
        std::memcpy(&reinterpret_cast<sockaddr_in&>(other).sin_addr, host, 4);
    } else {
        other.ss_family = AF_INET6;
        std::memcpy(&reinterpret_cast<sockaddr_in6&>(other).sin6_addr, host, 16);
    }
    check(list.allows(other) == (bits_of(network, size).substr(0, n) == bits_of(host, size).substr(0, n)));
    check(bits_of(network, size).find('1', n) == std::string::npos);
}

void check_listen(const std::string& text) {
    const ListenAddress found = check_listen_address(text);
    if (!found.fault.empty()) return;
    const bool v4 = found.bytes.ss_family == AF_INET;
    const in6_addr loopback = IN6ADDR_LOOPBACK_INIT;
    const auto& of_v4 = reinterpret_cast<const sockaddr_in&>(found.bytes);
    const auto& of_v6 = reinterpret_cast<const sockaddr_in6&>(found.bytes);
    check(found.size == (v4 ? sizeof of_v4 : sizeof of_v6));
    check((v4 ? of_v4.sin_port : of_v6.sin6_port) != 0);
    check(found.loopback ==
          (v4 ? ntohl(of_v4.sin_addr.s_addr) >> 24 == 127 : std::memcmp(&of_v6.sin6_addr, &loopback, sizeof loopback) == 0));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto* const end = static_cast<const std::uint8_t*>(size == 0 ? nullptr : std::memchr(data, 0, size));
    const std::size_t length = end == nullptr ? size : std::size_t(end - data);
    const std::string text(reinterpret_cast<const char*>(data), length);
    check_network(text, {data + length, size - length});
    check_listen(text);
    return 0;
}
