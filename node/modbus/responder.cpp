#include "node/modbus/responder.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "config/options.hpp"

namespace tactiled::modbus {
namespace {

constexpr std::size_t kAddressInRtu = 1;

// The addresses are not opened: the context gets the descriptor of an existing connection.
modbus_t* new_context(ModbusWire wire) {
    return wire == ModbusWire::tcp ? modbus_new_tcp("127.0.0.1", 1502) : modbus_new_rtu("tty", 19200, 'E', 8, 1);
}

// Converts the result of send() and write(), which is -1 also for a partial write.
std::size_t bytes_of(int sent) noexcept { return sent > 0 ? std::size_t(sent) : 0; }

}  // namespace

Responder::Responder(ModbusWire wire) : wire_(wire), context_(new_context(wire)) {
    if (context_ == nullptr) throw SetupError(fmt::format("Modbus: {}", std::strerror(errno)));
    // libmodbus sleeps this long before some exceptions, which requests that passed check_pdu() do not cause.
    modbus_set_response_timeout(context_.get(), 0, 1);
}

std::span<const std::uint8_t> Responder::pdu_of(std::span<const std::uint8_t> request) const noexcept {
    if (wire_ == ModbusWire::tcp) return request.subspan(kMbapSize);
    return request.subspan(kAddressInRtu, request.size() - kAddressInRtu - kCrcSize);
}

std::size_t Responder::reply(std::span<const std::uint8_t> request, Tables& tables) noexcept {
    modbus_mapping_t map{};
    map.nb_registers = map.nb_input_registers = int(tables.registers.size());
    map.tab_registers = map.tab_input_registers = tables.registers.data();
    map.nb_bits = int(tables.coils.size());
    map.tab_bits = tables.coils.data();
    map.nb_input_bits = int(tables.inputs.size());
    map.tab_input_bits = tables.inputs.data();
    std::array<std::uint8_t, kMaxAdu> aside;
    const auto pdu = pdu_of(request);
    if (pdu[0] == kReadWrite) {
        // Function 23 writes before it reads. Controls has carried out the write and determines what its registers
        // read as, so libmodbus writes to cells beyond the map. The answer does not contain the address of the write.
        std::copy(request.begin(), request.end(), aside.begin());
        std::uint8_t* const write_at = aside.data() + (pdu.data() - request.data()) + 5;
        write_at[0] = kMapEnd >> 8;
        write_at[1] = kMapEnd & 0xFF;
        request = std::span(aside).first(request.size());
    }
    return bytes_of(modbus_reply(context_.get(), request.data(), int(request.size()), &map));
}

std::size_t Responder::refuse(std::span<const std::uint8_t> request, Exception exception) noexcept {
    if (is_broadcast(request)) return 0;
    const std::uint8_t function = pdu_of(request)[0];
    if ((function & kExceptionBit) == 0) return bytes_of(modbus_reply_exception(context_.get(), request.data(), exception));
    const std::uint8_t pdu[] = {function, exception};  // libmodbus adds the exception bit
    return send(request, pdu);
}

std::size_t Responder::send(std::span<const std::uint8_t> request, std::span<const std::uint8_t> pdu) noexcept {
    if (is_broadcast(request)) return 0;
    std::array<std::uint8_t, kMaxAdu> out;
    if (wire_ == ModbusWire::rtu) {
        out[0] = request[0];
        std::copy(pdu.begin(), pdu.end(), out.begin() + kAddressInRtu);
        return bytes_of(modbus_send_raw_request(context_.get(), out.data(), int(kAddressInRtu + pdu.size())));
    }
    // modbus_send_raw_request() would choose its own transaction number.
    std::copy_n(request.begin(), kMbapSize, out.begin());
    out[4] = 0;
    out[5] = std::uint8_t(pdu.size() + 1);
    std::copy(pdu.begin(), pdu.end(), out.begin() + kMbapSize);
    const std::size_t size = kMbapSize + pdu.size();
    const ssize_t sent = ::send(modbus_get_socket(context_.get()), out.data(), size, MSG_NOSIGNAL);
    return sent == ssize_t(size) ? size : 0;
}

}  // namespace tactiled::modbus
