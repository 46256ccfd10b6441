#include "node/modbus/rtu.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <boost/crc.hpp>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/tty.hpp"
#include "node/log.hpp"

namespace tactiled::modbus {
namespace {

constexpr std::uint64_t kRetryNs = 1'000'000'000;
constexpr std::uint64_t kEchoLateNs = 2'000'000;  // beyond the line's own time

// 3.5 characters of 11 bits; above 19200 baud the standard fixes 1.75 ms (2.5.1.1).
std::uint64_t silence_ns(int baud) { return baud > 19200 ? 1'750'000 : std::uint64_t(3.5 * 11 * 1e9 / baud); }

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

std::uint16_t rtu_crc(std::span<const std::uint8_t> bytes) noexcept {
    boost::crc_optimal<16, 0x8005, 0xFFFF, 0, true, true> crc;
    crc.process_bytes(bytes.data(), bytes.size());
    return crc.checksum();
}

std::size_t adu_of_rtu(std::span<const std::uint8_t> frame, std::span<std::uint8_t, kMaxAdu> out) noexcept {
    if (frame.size() < 4 || frame.size() > kMaxRtu) return 0;
    const std::uint16_t crc = rtu_crc(frame.first(frame.size() - 2));
    if (frame[frame.size() - 2] != (crc & 0xFF) || frame[frame.size() - 1] != crc >> 8) return 0;
    const std::size_t length = frame.size() - 2;
    const std::uint8_t header[] = {0, 0, 0, 0, 0, std::uint8_t(length)};
    std::copy(std::begin(header), std::end(header), out.begin());
    std::copy_n(frame.begin(), length, out.begin() + 6);
    return 6 + length;
}

std::size_t rtu_of_adu(std::span<const std::uint8_t> adu, std::span<std::uint8_t, kMaxRtu> out) noexcept {
    const std::size_t length = adu.size() - 6;
    std::copy_n(adu.begin() + 6, length, out.begin());
    const std::uint16_t crc = rtu_crc(out.first(length));
    out[length] = std::uint8_t(crc & 0xFF);
    out[length + 1] = std::uint8_t(crc >> 8);
    return length + 2;
}

RtuLine::RtuLine(const RtuSettings& settings)
    : settings_(settings),
      silence_ns_(settings.silence_us > 0 ? std::uint64_t(settings.silence_us) * 1000 : silence_ns(settings.baud)) {}

void RtuLine::open(std::uint64_t now_ns) {
    std::string why;
    fd_ = open_tty(settings_.device, tty_of(settings_), why);
    open_again_ns_ = now_ns + kRetryNs;
    received_ = 0;
    silent_since_ns_ = 0;
    too_long_ = false;
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

void RtuLine::close() noexcept {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
}

bool RtuLine::receive(std::uint64_t now_ns) {
    // Bytes that come after more than t3.5 of silence begin a new frame, even where nobody has looked in between.
    if (silent_since_ns_ != 0 && now_ns > frame_ends_ns()) {
        received_ = 0;
        too_long_ = false;
        ++counts_.bad_frames;
    }
    std::uint8_t bytes[512];
    const ssize_t size = ::read(fd_, bytes, sizeof bytes);
    if (size <= 0) {
        if (size < 0 && (errno == EAGAIN || errno == EINTR)) return true;
        close();
        open_again_ns_ = now_ns + kRetryNs / 10;
        return false;
    }
    silent_since_ns_ = now_ns;
    const std::size_t room = frame_.size() - received_;
    too_long_ |= std::size_t(size) > room;
    const std::size_t taken = std::min(room, std::size_t(size));
    std::copy_n(bytes, taken, frame_.data() + received_);
    received_ += taken;
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
    too_long_ = false;
    silent_since_ns_ = 0;
}

// A frame that is not for us, or is none, is answered by silence (2.2: the other units on the line do the same).
void RtuLine::take_frame(const Answer& answer, std::uint64_t now_ns) {
    if (is_echo(now_ns)) return;
    std::array<std::uint8_t, kMaxAdu> request, reply;
    const std::size_t size = adu_of_rtu(std::span(frame_).first(received_), request);
    if (size == 0) {
        ++counts_.bad_frames;
        return;
    }
    const std::uint8_t address = request[6];
    if (address != 0 && address != settings_.address) {
        ++counts_.for_others;
        return;
    }
    ++counts_.frames;
    const std::size_t length = answer(std::span(request).first(size), reply);
    if (address == 0) {
        ++counts_.broadcasts;
        return;
    }
    std::array<std::uint8_t, kMaxRtu> frame;
    const std::size_t bytes = rtu_of_adu(std::span(reply).first(length), frame);
    // At most 256 bytes: the kernel's buffer takes them. What it does not take the master misses, and asks again.
    [[maybe_unused]] const auto written = ::write(fd_, frame.data(), bytes);
    sent_ = frame;
    sent_size_ = bytes;
    const auto line_ns = std::uint64_t(double(bytes) * 11 * 1e9 / settings_.baud);
    echo_until_ns_ = now_ns + line_ns + 2 * silence_ns_ + kEchoLateNs;
}

// Our own answer come back, once: no master repeats a request that early, and the answer to a write looks like one.
bool RtuLine::is_echo(std::uint64_t now_ns) noexcept {
    const std::size_t size = std::exchange(sent_size_, 0);
    if (size == 0 || now_ns > echo_until_ns_ || received_ != size ||
        !std::equal(sent_.begin(), sent_.begin() + long(size), frame_.begin()))
        return false;
    ++counts_.echoes;
    return true;
}

}  // namespace tactiled::modbus
