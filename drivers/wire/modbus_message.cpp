#include "drivers/wire/modbus_message.hpp"

#include <algorithm>
#include <boost/crc.hpp>
#include <cstring>

namespace tactiled {
namespace {

using modbus::kCrcSize, modbus::kExceptionBit, modbus::kWriteRegister, modbus::kWriteRegisters;
constexpr std::size_t kMbap = modbus::kMbapSize - 1;  // without the unit, which RTU has, too
constexpr std::size_t kLongestBody = 1 + modbus::kMaxPdu;

bool reads(const ModbusRequest& request) noexcept {
    return request.function == modbus::kReadHolding || request.function == modbus::kReadInputRegisters;
}

std::uint16_t get16(const std::uint8_t* bytes) noexcept { return std::uint16_t(bytes[0] << 8 | bytes[1]); }

void put16(std::uint8_t*& at, std::uint16_t value) noexcept {
    *at++ = std::uint8_t(value >> 8);
    *at++ = std::uint8_t(value);
}

// Returns the length of unit and PDU of a good answer.
std::size_t answer_body(const ModbusRequest& request) noexcept { return reads(request) ? 3 + 2u * request.count : 6; }

}  // namespace

std::uint16_t modbus_crc(std::span<const std::uint8_t> bytes) noexcept {
    boost::crc_optimal<16, 0x8005, 0xFFFF, 0, true, true> crc;
    crc.process_bytes(bytes.data(), bytes.size());
    return crc.checksum();
}

std::size_t encode_modbus(ModbusWire wire, const ModbusRequest& request,
                          std::span<std::uint8_t, kModbusMaxRequest> out) noexcept {
    std::uint8_t* at = out.data();
    if (wire == ModbusWire::tcp) {
        put16(at, request.transaction);
        put16(at, 0);
        put16(at, request.function == kWriteRegisters ? 9 : 6);
    }
    *at++ = request.unit;
    *at++ = request.function;
    put16(at, request.at);
    if (request.function == kWriteRegisters) {
        put16(at, 1);
        *at++ = 2;
    }
    put16(at, reads(request) ? request.count : request.value);
    if (wire == ModbusWire::rtu) {
        const std::uint16_t crc = modbus_crc({out.data(), std::size_t(at - out.data())});
        put16(at, std::uint16_t(crc << 8 | crc >> 8));
    }
    return std::size_t(at - out.data());
}

std::size_t modbus_answer_bytes(ModbusWire wire, const ModbusRequest& request) noexcept {
    return answer_body(request) + (wire == ModbusWire::rtu ? kCrcSize : kMbap);
}

void ModbusAnswers::reset() noexcept {
    size_ = 0;
    open_ = false;
}

void ModbusAnswers::expect(const ModbusRequest& request) noexcept {
    if (wire_ == ModbusWire::rtu) drop(size_);
    request_ = request;
    open_ = true;
    checksum_failed_ = other_length_ = echo_seen_ = false;
    if (wire_ == ModbusWire::rtu) n_sent_ = encode_modbus(wire_, request, sent_);
}

ModbusAnswers::Found ModbusAnswers::next() noexcept {
    const Found found = wire_ == ModbusWire::rtu ? next_rtu() : next_tcp();
    if (found != Found::nothing) open_ = false;
    return found;
}

// RTU messages are separated only by silences, which USB adapters do not preserve. Bytes with the right unit, function,
// length and CRC are therefore the answer, at any position, and noise before them is ignored.
//
// An adapter may echo its own request. If one register is read, the beginning of that echo can be a whole answer (0x0200 ..
// 0x02FF, if the CRC happens to fit), so the first exact copy of the request is skipped before anything is judged. Its 8
// bytes are not the length of an answer. The confirmation of a write with function 6 is such a copy itself: the first copy
// is then skipped only on a line that has echoed the last read.
ModbusAnswers::Found ModbusAnswers::next_rtu() noexcept {
    std::size_t at = 0;
    Found found = Found::nothing;
    for (; open_ && found == Found::nothing && at < size_; ++at) {
        const std::uint8_t* const message = &bytes_[at];
        const std::size_t left = size_ - at;
        if (message[0] != request_.unit) continue;
        if (!echo_seen_ && (request_.function != kWriteRegister || line_echoes_) &&
            std::equal(message, message + std::min(left, n_sent_), sent_.begin())) {
            if (left < n_sent_) break;
            echo_seen_ = true;
            if (reads(request_)) line_echoes_ = true;
            at += n_sent_ - 1;
            continue;
        }
        if (left < 2) break;
        const bool failed = message[1] == (request_.function | kExceptionBit);
        if (message[1] != request_.function && !failed) continue;
        if (left < 3) break;
        const std::size_t body = failed ? 3 : answer_body(request_);
        if (!failed && reads(request_) && message[2] != 2u * request_.count) {
            other_length_ = true;
            continue;
        }
        if (left < body + kCrcSize) break;
        const std::uint16_t crc = modbus_crc({message, body});
        if (message[body] != (crc & 0xFF) || message[body + 1] != crc >> 8) {
            checksum_failed_ = true;
            continue;
        }
        found = judge(message, body);
        if (found == Found::good || found == Found::refused) {
            if (reads(request_)) line_echoes_ = echo_seen_;
            const std::size_t end = at + body + kCrcSize;
            skipped += std::uint32_t(at);
            std::memmove(bytes_.data(), bytes_.data() + end, size_ - end);
            size_ -= end;
            return found;
        }
        found = Found::nothing;  // the echo of another write
    }
    drop(open_ ? at : size_);
    return found;
}

ModbusAnswers::Found ModbusAnswers::next_tcp() noexcept {
    while (size_ >= kMbap + 2) {
        const std::size_t body = get16(&bytes_[4]);
        if (get16(&bytes_[2]) != 0 || body < 3 || body > kLongestBody) return Found::broken;
        if (size_ < kMbap + body) break;
        Found found = Found::nothing;
        const bool ours = open_ && get16(&bytes_[0]) == request_.transaction;
        if (ours) found = judge(&bytes_[kMbap], body);
        if (found != Found::good && found != Found::refused) skipped += std::uint32_t(kMbap + body);
        std::memmove(bytes_.data(), bytes_.data() + kMbap + body, size_ - kMbap - body);
        size_ -= kMbap + body;
        if (ours) return found;
    }
    return Found::nothing;
}

ModbusAnswers::Found ModbusAnswers::judge(const std::uint8_t* message, std::size_t size) noexcept {
    if (message[0] != request_.unit) return Found::foreign;
    if (message[1] == (request_.function | kExceptionBit)) {
        if (size != 3) return Found::wrong_length;
        exception_ = message[2];
        return Found::refused;
    }
    if (message[1] != request_.function) return Found::foreign;
    if (size != answer_body(request_)) return Found::wrong_length;
    n_registers_ = 0;
    if (!reads(request_)) {
        const std::uint16_t second = request_.function == kWriteRegisters ? 1 : request_.value;
        return get16(message + 2) == request_.at && get16(message + 4) == second ? Found::good : Found::foreign;
    }
    if (message[2] != 2u * request_.count) return Found::wrong_length;
    n_registers_ = request_.count;
    for (std::size_t i = 0; i < n_registers_; ++i) registers_[i] = get16(message + 3 + 2 * i);
    return Found::good;
}

tactiled_link_count ModbusAnswers::missing() const noexcept {
    if (checksum_failed_) return TACTILED_LINK_BAD_CHECKSUM;
    // RTU keeps only bytes that may begin the expected answer, TCP the beginning of a message.
    if (other_length_ || size_ != 0) return TACTILED_LINK_BAD_LENGTH;
    return TACTILED_LINK_BUS_ERROR;
}

void ModbusAnswers::drop(std::size_t n) noexcept {
    n = std::min(n, size_);
    skipped += std::uint32_t(n);
    std::memmove(bytes_.data(), bytes_.data() + n, size_ - n);
    size_ -= n;
}

}  // namespace tactiled
