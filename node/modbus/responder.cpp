#include "node/modbus/responder.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "config/options.hpp"

namespace tactiled::modbus {

bool is_answer_to(std::span<const std::uint8_t> request, std::span<const std::uint8_t> answer) noexcept {
    return answer.size() > kMbapSize && std::equal(answer.begin(), answer.begin() + 4, request.begin()) &&
           std::size_t(answer[4] << 8 | answer[5]) == answer.size() - 6 && answer[6] == request[6];
}

Responder::Responder() : context_(modbus_new_tcp("127.0.0.1", 1502)) {
    if (context_ == nullptr || ::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair_.data()) != 0)
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
                              std::span<std::uint8_t, kMaxAdu> out) noexcept {
    modbus_mapping_t map{};
    map.nb_registers = map.nb_input_registers = int(tables.registers.size());
    map.tab_registers = map.tab_input_registers = tables.registers.data();
    map.nb_bits = int(tables.coils.size());
    map.tab_bits = tables.coils.data();
    map.nb_input_bits = int(tables.inputs.size());
    map.tab_input_bits = tables.inputs.data();
    (void)modbus_reply(context_.get(), adu.data(), int(adu.size()), &map);  // what came of it is judged by its bytes
    const auto length = std::size_t(std::max<ssize_t>(::recv(pair_[1], out.data(), out.size(), MSG_DONTWAIT), 0));
    return is_answer_to(adu, out.first(length)) ? length : exception_adu(adu, kDeviceFailure, out);
}

}  // namespace tactiled::modbus
