#include "config/network_address.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string_view>

#include "config/options.hpp"

namespace tactiled {
namespace {

struct Address {
    std::array<std::uint8_t, 16> bytes;
    unsigned bits;  // 32 or 128
};

std::optional<Address> parse_address(const std::string& text) {
    Address address{{}, 32};
    if (::inet_pton(AF_INET, text.c_str(), address.bytes.data()) == 1) return address;
    address.bits = 128;
    if (::inet_pton(AF_INET6, text.c_str(), address.bytes.data()) == 1) return address;
    return std::nullopt;
}

std::string text_of(const Address& address) {
    char text[INET6_ADDRSTRLEN];
    return ::inet_ntop(address.bits == 32 ? AF_INET : AF_INET6, address.bytes.data(), text, sizeof text);
}

std::optional<unsigned> parse_number(std::string_view text, unsigned min, unsigned max) {
    unsigned value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || value < min || value > max) return std::nullopt;
    return value;
}

bool is_loopback(const Address& address) {
    if (address.bits == 32) return address.bytes[0] == 127;
    return text_of(address) == "::1";
}

}  // namespace

ListenAddress check_listen_address(const std::string& text) {
    const auto wrong = [&](const std::string& why) {
        return ListenAddress{.fault = fmt::format("listen = {} {}", in_quotes(text), why)};
    };
    const std::size_t colon = text.rfind(':');
    if (colon == text.npos) return wrong("has no port; write ADDRESS:PORT, for example \"127.0.0.1:1502\"");
    std::string host = text.substr(0, colon);
    const bool bracketed = host.size() >= 2 && host.front() == '[' && host.back() == ']';
    if (bracketed) host = host.substr(1, host.size() - 2);
    const auto address = parse_address(host);
    if (!address || bracketed != (address->bits == 128))
        return wrong(
            "has no numeric address; write \"192.168.0.5:502\" or \"[::1]:502\" (127.0.0.1 for localhost, 0.0.0.0 for every "
            "interface)");
    const auto port = parse_number(std::string_view(text).substr(colon + 1), 1, 65535);
    if (!port) return wrong("has no port of 1 .. 65535 at its end");
    ListenAddress listen{.fault = "", .loopback = is_loopback(*address)};
    auto& v4 = reinterpret_cast<sockaddr_in&>(listen.bytes);
    auto& v6 = reinterpret_cast<sockaddr_in6&>(listen.bytes);
    v4.sin_family = bracketed ? AF_INET6 : AF_INET;
    v4.sin_port = htons(std::uint16_t(*port));  // both families have the port in the same place
    std::memcpy(bracketed ? static_cast<void*>(&v6.sin6_addr) : &v4.sin_addr, address->bytes.data(), address->bits / 8);
    listen.size = bracketed ? sizeof v6 : sizeof v4;
    return listen;
}

std::string fault_of_network(const std::string& text) {
    const std::size_t slash = text.find('/');
    const auto address = parse_address(text.substr(0, slash));
    if (!address) return in_quotes(text) + " is no network; write ADDRESS/BITS, for example \"192.168.0.0/24\"";
    if (slash == text.npos)
        return fmt::format("\"{0}\" says no network size; write \"{0}/{1}\" for this one machine", text, address->bits);
    const auto bits = parse_number(std::string_view(text).substr(slash + 1), 0, address->bits);
    if (!bits) return fmt::format("{} should end with /0 .. /{}", in_quotes(text), address->bits);
    if (*bits == 0)
        return in_quotes(text) +
               " is every machine; name the network or the address of the PLC, for example \"192.168.0.10/32\"";
    Address network = *address;
    for (unsigned bit = *bits; bit < address->bits; ++bit)
        network.bytes[bit / 8] = std::uint8_t(network.bytes[bit / 8] & ~(0x80u >> (bit % 8)));
    if (network.bytes == address->bytes) return "";
    return fmt::format(
        "\"{}\" names a machine and a network at once; write \"{}/{}\" for the machine, \"{}/{}\" for the network", text,
        text_of(*address), address->bits, text_of(network), *bits);
}

}  // namespace tactiled
