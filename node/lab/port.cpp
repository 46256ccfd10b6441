#include "node/lab/port.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <pty.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "config/options.hpp"
#include "node/ctl/command_line.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

// The bytes of a tty pass through a worker of the kernel that runs with ordinary priority, so a reader waits for it:
// 0.23 s beside eight busy programs on two CPUs (2026-11-22).
constexpr std::uint64_t kPatienceNs = 1'000'000'000;
constexpr std::uint64_t kAnswerNs = 2'000'000;  // a microcontroller answers between two frames, too
constexpr std::size_t kMaxRequest = 256;

void sleep_until(std::uint64_t due_ns) {
    const timespec due{time_t(due_ns / 1'000'000'000u), long(due_ns % 1'000'000'000u)};
    while (interrupted == 0 && ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr) == EINTR) {}
}

}  // namespace

Port::Port(const std::string& link) : link_(link) {
    char name[128];
    int slave = -1;
    if (::openpty(&master_, &slave, name, nullptr, nullptr) != 0)
        throw SetupError(fmt::format("pty: {}", std::strerror(errno)));
    termios raw{};
    ::tcgetattr(slave, &raw);
    ::cfmakeraw(&raw);
    ::tcsetattr(slave, TCSANOW, &raw);
    ::close(slave);
    ::fcntl(master_, F_SETFL, O_NONBLOCK);
    std::error_code error;
    const auto kind = std::filesystem::symlink_status(link, error).type();
    if (kind == std::filesystem::file_type::symlink) std::filesystem::remove(link, error);  // left by an earlier run
    std::filesystem::create_symlink(name, link, error);
    if (error) {
        ::close(master_);
        throw SetupError(fmt::format("{}: {}", link, error.message()));
    }
}

Port::~Port() {
    ::unlink(link_.c_str());
    ::close(master_);
}

bool Port::has_reader() const {
    pollfd p{master_, POLLOUT, 0};
    ::poll(&p, 1, 0);
    return (p.revents & POLLHUP) == 0;
}

bool Port::send(const void* bytes, std::size_t size) {
    const auto* at = static_cast<const char*>(bytes);
    const std::uint64_t until_ns = monotonic_ns() + (is_stuck_ ? 0 : kPatienceNs);
    for (;;) {
        const ssize_t taken = ::write(master_, at, size);
        if (taken > 0) {
            at += taken;
            size -= std::size_t(taken);
        }
        is_stuck_ = size != 0 && monotonic_ns() >= until_ns;
        if (size == 0 || is_stuck_ || interrupted != 0) return size == 0;
        ::usleep(1'000);
    }
}

std::string Port::receive() {
    std::array<char, kMaxRequest> piece;
    const ssize_t size = ::read(master_, piece.data(), piece.size());
    if (size > 0) received_.append(piece.data(), std::size_t(size));
    const std::size_t end = received_.find('\n');
    if (end == received_.npos) {
        if (received_.size() > kMaxRequest) received_.clear();
        return "";
    }
    std::string line = received_.substr(0, end);
    received_.erase(0, end + 1);
    return line;
}

void Port::set_clock(std::uint64_t time_us, std::uint64_t at_ns) noexcept {
    clock_us_ = time_us;
    clock_ns_ = at_ns;
}

std::uint64_t Port::clock_us(std::uint64_t at_ns) const noexcept {
    return clock_us_ + (std::max(at_ns, clock_ns_) - clock_ns_) / 1000;
}

void Wire::add_options(Command verb) {
    const auto names = StreamFormats::names([](const StreamFormat& each) { return each.encode != nullptr; });
    verb.add_option("--format", name, "wire format").one_of(names).show_default();
    verb.add_option("--bits", settings.bits, "binary formats: width of a channel").one_of({"24", "32"}).show_default();
    verb.add_option("--counts-per-unit", counts_per_unit, "factor of the values that are sent").show_default();
    verb.add_flag("--checksum", settings.checksum, "text formats: with a checksum by exclusive or");
    verb.add_flag("--crc16", settings.crc16, "text formats: with a CRC-16");
    verb.add_flag("--sequence", settings.sequence, "text formats: with a leading counter (binary ones always have one)");
    verb.add_flag("--time", settings.time_us, "with the device's time");
}

const StreamFormat& Wire::format() const { return *StreamFormats::find(name); }

bool Wire::send(Port& port, Frame frame) const {
    if (!settings.time_us) frame.device_time_us = 0;
    for (std::size_t k = 0; k < frame.n_channels; ++k) {
        frame.channel[k] *= counts_per_unit;
        if (std::isnan(frame.channel[k])) frame.missing |= 1u << k;
    }
    const std::vector<std::uint8_t> bytes = format().encode(frame, settings);
    return port.send(bytes.data(), bytes.size());
}

void Wire::answer_until(std::uint64_t due_ns, std::span<const std::unique_ptr<Port>> ports) const {
    const auto answer = format().answer;
    if (answer == nullptr) return sleep_until(due_ns);
    do {
        sleep_until(std::min(due_ns, monotonic_ns() + kAnswerNs));
        for (const auto& port : ports)
            for (std::string line = port->receive(); !line.empty(); line = port->receive()) {
                // The time of an answer is not after that of the frame that follows, however late this thread is.
                const std::uint64_t at_ns = std::min(due_ns, monotonic_ns());
                const auto bytes = answer(line, std::uint32_t(port->clock_us(at_ns)), settings);
                (void)port->send(bytes.data(), bytes.size());
            }
    } while (interrupted == 0 && monotonic_ns() < due_ns);
}

void wait_for_reader(const Port& port) {
    while (interrupted == 0 && !port.has_reader()) ::usleep(2'000);
    ::usleep(20'000);  // lets the opener set its tty up and flush it
}

void let_reader_finish() {
    if (interrupted == 0) ::usleep(200'000);
}

}  // namespace tactiled::ctl
