#include "node/modbus/rtu.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/tty.hpp"
#include "drivers/wire/modbus_message.hpp"
#include "node/log.hpp"

namespace tactiled::modbus {
namespace {

constexpr std::uint64_t kRetryNs = 1'000'000'000;
constexpr std::uint64_t kEchoLateNs = 2'000'000;  // in addition to the time on the line

// 1.75 ms is the standard's recommendation for t3.5 above 19200 baud (2.5.1.1). A UART's receive buffer delivers its
// bytes after at most four characters of silence, so that the pieces of a frame are closer together.
constexpr std::uint64_t kPiecesNs = 1'750'000;

std::uint64_t silence_ns(int baud) { return std::uint64_t(3.5 * 11 * 1e9 / baud); }  // a character has 11 bits

TtySettings tty_of(const RtuSettings& settings) {
    TtySettings tty;
    using Parity = TtySettings::Parity;
    tty.baud = unsigned(settings.baud);
    tty.parity = settings.parity == "even" ? Parity::even : settings.parity == "odd" ? Parity::odd : Parity::none;
    tty.two_stop_bits = tty.parity == Parity::none;  // a character always has 11 bits (2.5.1)
    tty.answers = true;
    tty.rs485 = settings.rs485;
    return tty;
}

}  // namespace

bool is_rtu_frame(std::span<const std::uint8_t> frame) noexcept {
    if (frame.size() < 4 || frame.size() > kMaxRtu) return false;  // address, function, checksum
    const std::uint16_t crc = modbus_crc(frame.first(frame.size() - kCrcSize));
    return frame[frame.size() - 2] == (crc & 0xFF) && frame[frame.size() - 1] == crc >> 8;
}

bool is_whole_request(std::span<const std::uint8_t> bytes) noexcept {
    const auto with_data = [&](std::size_t count_at) {  // bytes before the data, the data, the checksum
        return bytes.size() > count_at ? count_at + 1 + bytes[count_at] + kCrcSize : SIZE_MAX;
    };
    if (!is_rtu_frame(bytes)) return false;
    switch (bytes[1]) {
        case kReadCoils:
        case kReadInputs:
        case kReadHolding:
        case kReadInputRegisters:
        case kWriteCoil:
        case kWriteRegister: return bytes.size() == 8;
        case kWriteCoils:
        case kWriteRegisters: return bytes.size() == with_data(6);
        case kReportServerId: return bytes.size() == 4;
        case kMaskWrite: return bytes.size() == 10;
        case kReadWrite: return bytes.size() == with_data(10);
        case kEncapsulated: return bytes.size() == 7;
        default: return false;  // the length is unknown or free: silence ends it
    }
}

bool is_answer_to(std::span<const std::uint8_t> request, std::span<const std::uint8_t> frame) noexcept {
    if (frame[0] != request[0]) return false;
    const std::size_t size = frame.size();
    if ((frame[1] & kExceptionBit) != 0) return size == 5 && frame[1] == (request[1] | kExceptionBit);
    if (frame[1] != request[1]) return false;
    const auto starts_as_the_request = [&](std::size_t n) {
        return size >= n && request.size() >= n && std::equal(frame.begin(), frame.begin() + long(n), request.begin());
    };
    switch (frame[1]) {
        // a request may have the byte count of an answer in this place, too: the high byte of its address
        case kReadWrite:
            if (size >= 15 && frame[10] == size - 13 && frame[9] * 2u == frame[10]) return false;
            [[fallthrough]];
        case kReadCoils:
        case kReadInputs:
        case kReadHolding:
        case kReadInputRegisters:
        case kReportServerId: return size > 5 && frame[2] == size - 5;
        case kEncapsulated: return size > 7 && starts_as_the_request(4);
        case kWriteCoils:
        case kWriteRegisters: return size == 8 && starts_as_the_request(6);
        default: return size == request.size() && starts_as_the_request(size);  // the request itself
    }
}

RtuLine::RtuLine(const RtuSettings& settings)
    : settings_(settings),
      silence_ns_(settings.silence_us > 0 ? std::uint64_t(settings.silence_us) * 1000 : silence_ns(settings.baud)),
      pieces_ns_(std::max(silence_ns_, kPiecesNs)) {}

void RtuLine::open(std::uint64_t now_ns) {
    std::string why;
    fd_.reset(open_tty(settings_.device, tty_of(settings_), why));
    responder.set_descriptor(fd_);
    open_again_ns_ = now_ns + kRetryNs;
    received_ = 0;
    silent_since_ns_ = 0;
    too_long_ = is_whole_ = false;
    sent_size_ = 0;
    if (fd_ >= 0) {
        log_line(LogLevel::info, "Modbus RTU: {}, address {}, {} baud, {} parity", settings_.device, settings_.address,
                 settings_.baud, settings_.parity);
        complaint_.clear();
    } else if (why != complaint_) {
        log_line(LogLevel::warning, "Modbus RTU: {}; trying again each second", why);
        complaint_ = why;
    }
}

bool RtuLine::receive(std::uint64_t now_ns) {
    // Bytes after the silence that ends a frame begin a new one, even if tick() was not called in between.
    if (silent_since_ns_ != 0 && now_ns > frame_ends_ns()) {
        received_ = 0;
        too_long_ = is_whole_ = false;
        ++counts_.bad_frames;
    }
    std::uint8_t bytes[512];
    const ssize_t size = ::read(fd_, bytes, sizeof bytes);
    if (size <= 0) {
        if (size < 0 && (errno == EAGAIN || errno == EINTR)) return true;
        fd_.reset();
        open_again_ns_ = now_ns + kRetryNs / 10;
        return false;
    }
    silent_since_ns_ = now_ns;
    const std::size_t room = frame_.size() - received_;
    too_long_ |= std::size_t(size) > room;
    const std::size_t taken = std::min(room, std::size_t(size));
    std::copy_n(bytes, taken, frame_.data() + received_);
    received_ += taken;
    is_whole_ = !too_long_ && is_whole_request(std::span(frame_).first(received_));
    return true;
}

void RtuLine::tick(const Answer& answer, std::uint64_t now_ns) {
    if (fd_ < 0 && now_ns >= open_again_ns_) open(now_ns);
    if (fd_ < 0 || silent_since_ns_ == 0 || now_ns < frame_ends_ns()) return;
    if (too_long_)
        ++counts_.bad_frames;
    else
        take_frame(answer, now_ns);
    received_ = 0;
    too_long_ = is_whole_ = false;
    silent_since_ns_ = 0;
}

// A frame for another unit, or an invalid one, is not answered (2.2: the other units on the line do the same).
void RtuLine::take_frame(const Answer& answer, std::uint64_t now_ns) {
    const auto frame = std::span(std::as_const(frame_)).first(received_);
    const bool may_be_echo = std::exchange(sent_size_, 0) == received_ && now_ns <= echo_until_ns_;
    if (!is_rtu_frame(frame)) {
        ++counts_.bad_frames;
        return;
    }
    // Only once: no master repeats a request that early, and the answer to a write may equal its request.
    if (may_be_echo && is_answer_to(std::span(answered_).first(answered_size_), frame)) {
        ++counts_.echoes;
        return;
    }
    const std::uint8_t address = frame[0];
    if (address != 0 && address != settings_.address) {
        ++counts_.for_others;
        return;
    }
    ++counts_.frames;
    // If the kernel does not take the answer, which has at most 256 bytes, the master misses it and repeats the
    // request.
    sent_size_ = answer(frame);
    if (address == 0) {
        ++counts_.broadcasts;
        return;
    }
    std::copy(frame.begin(), frame.end(), answered_.begin());
    answered_size_ = frame.size();
    const auto line_ns = std::uint64_t(double(sent_size_) * 11 * 1e9 / settings_.baud);
    echo_until_ns_ = now_ns + line_ns + 2 * pieces_ns_ + kEchoLateNs;
}

}  // namespace tactiled::modbus
