#include "node/modbus/responder.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "config/options.hpp"

namespace tactiled::modbus {

Responder::Responder() : context_(modbus_new_tcp("127.0.0.1", 1502)) {
    if (context_ == nullptr || ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair_.data()) != 0)
        throw SetupError(fmt::format("Modbus: {}", std::strerror(errno)));
    modbus_set_socket(context_.get(), pair_[0]);
    modbus_set_response_timeout(context_.get(), 0,
                                1);  // it sleeps this long before some exceptions, none of which it meets here
}

Responder::~Responder() {
    ::close(pair_[0]);
    ::close(pair_[1]);
}

std::size_t Responder::answer(std::span<const std::uint8_t> adu, Tables& tables,
                              std::span<std::uint8_t, kMostAdu> out) noexcept {
    modbus_mapping_t map{};
    map.nb_registers = map.nb_input_registers = int(tables.registers.size());
    map.tab_registers = map.tab_input_registers = tables.registers.data();
    map.nb_bits = int(tables.coils.size());
    map.tab_bits = tables.coils.data();
    map.nb_input_bits = int(tables.inputs.size());
    map.tab_input_bits = tables.inputs.data();
    const int sent = modbus_reply(context_.get(), adu.data(), int(adu.size()), &map);
    const ssize_t size = ::recv(pair_[1], out.data(), out.size(), MSG_DONTWAIT);
    // The answer must be this request's: same transaction, protocol and unit, and as long as it says.
    const bool fits = sent > 0 && size == sent && size > ssize_t(kMbapSize) &&
                      std::equal(out.begin(), out.begin() + 4, adu.begin()) && (out[4] << 8 | out[5]) == int(size) - 6 &&
                      out[6] == adu[6];
    if (fits) return std::size_t(size);
    while (::recv(pair_[1], out.data(), out.size(), MSG_DONTWAIT) > 0) {  // else the rest would answer the next request
    }
    return exception_adu(adu, kDeviceFailure, out);
}

}  // namespace tactiled::modbus
