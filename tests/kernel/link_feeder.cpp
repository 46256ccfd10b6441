// link_feeder SECONDS UART RTU INTERFACE UART_HZ CAN_HZ: devices at fixed rates on three links at once, for
// four_links_test.py. UART and RTU are paths at which it leaves ptys: binary frames on the first, on the second a
// Modbus slave that answers any reading of registers. INTERFACE gets CAN FD messages of 64 bytes. Each millisecond,
// by absolute sleeps, it sends all due data; a delay is caught up as fast as the lines permit, and no frame is
// omitted. The first channel of both is the moment of sending, CLOCK_MONOTONIC in us, modulo a second. At the end it
// prints what it has sent, as JSON.
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/clock.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "drivers/wire/modbus_message.hpp"

namespace {

using namespace tactiled;

int open_pty(const char* path) {
    const int fd = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (fd < 0 || ::grantpt(fd) != 0 || ::unlockpt(fd) != 0) throw std::runtime_error("no pty");
    const int other = ::open(::ptsname(fd), O_RDWR | O_NOCTTY);  // stays open: the line is there before and after the daemon
    termios raw;
    ::tcgetattr(other, &raw);
    ::cfmakeraw(&raw);
    ::tcsetattr(other, TCSANOW, &raw);
    ::unlink(path);
    if (::symlink(::ptsname(fd), path) != 0) throw std::runtime_error(path);
    return fd;
}

int open_can(const char* interface) {
    const int fd = ::socket(PF_CAN, SOCK_RAW, CAN_RAW), on = 1;
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = int(::if_nametoindex(interface));
    if (::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
        ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
        throw std::runtime_error(interface);
    return fd;
}

class Feeder {
public:
    Feeder(char** words)
        : uart_(open_pty(words[2])),
          rtu_(open_pty(words[3])),
          can_(open_can(words[4])),
          uart_Hz_(std::stod(words[5])),
          can_Hz_(std::stod(words[6])) {}

    // Answers requests until a line of standard input ends this state.
    void answer_only() {
        pollfd reported{STDIN_FILENO, POLLIN, 0};
        while (::poll(&reported, 1, 1) == 0) answer_rtu();
        for (int c = 0; c != '\n' && c != EOF;) c = std::getchar();
    }

    void run(double seconds) {
        const std::uint64_t began_ns = now_ns();
        const auto due = [&](double rate_Hz, std::uint64_t at_ns) {
            return unsigned(std::ceil(std::min(double(at_ns - began_ns) * 1e-9, seconds) * rate_Hz));
        };
        const unsigned all_uart = due(uart_Hz_, UINT64_MAX), all_can = due(can_Hz_, UINT64_MAX);
        for (std::uint64_t wake_ns = began_ns, cycled_ns = began_ns; n_uart_ < all_uart || n_can_ < all_can;) {
            const timespec wake{time_t(wake_ns / 1'000'000'000), long(wake_ns % 1'000'000'000)};
            ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
            const std::uint64_t at_ns = now_ns();
            worst_late_ns_ = std::max(worst_late_ns_, at_ns - wake_ns);
            const auto cycle_ms = std::min(unsigned((at_ns - cycled_ns) / 1'000'000) + 1, kMaxHeld_ms);
            cycled_ns = at_ns;
            for (unsigned n = std::min(due(uart_Hz_, at_ns) - n_uart_, kMaxUart * cycle_ms); n > 0; --n) send_uart();
            for (unsigned n = std::min(due(can_Hz_, at_ns) - n_can_, kMaxCan * cycle_ms); n > 0;)
                n -= send_can(std::min(n, kMaxCan));
            answer_rtu();
            wake_ns = std::max(wake_ns + 1'000'000, at_ns);
        }
        std::printf(
            "{\"seconds\": %.2f, \"uart\": %u, \"can\": %u, \"modbus\": %u, \"refused\": %u, \"worst_late_ms\": %.1f}\n",
            double(now_ns() - began_ns) * 1e-9, n_uart_, n_can_, n_rtu_, n_refused_, double(worst_late_ns_) * 1e-6);
        std::fflush(stdout);
    }

private:
    // Limits of the lines in a millisecond: 38 bytes at 921600 baud, 64 bytes at 1 and 5 Mbit/s.
    static constexpr unsigned kMaxUart = 2, kMaxCan = 7;
    // limit of the data after a delay of this program: as much as adapters hold
    static constexpr unsigned kMaxHeld_ms = 20;

    static std::uint32_t sent_us() noexcept { return std::uint32_t(now_ns() / 1000 % 1'000'000); }

    void send_uart() {
        Frame frame;
        frame.sequence = n_uart_ & 0xFFFFu;
        frame.n_channels = 8;
        frame.channel[0] = double(sent_us());
        std::array<std::uint8_t, kCobsMaxEncoded> bytes;
        const std::size_t n = encode_cobs(frame, 24, bytes);
        if (::write(uart_, bytes.data(), n) != ssize_t(n)) ++n_refused_;  // there is no reader
        ++n_uart_;
    }
    // With one system call: a bus's controller has none.
    unsigned send_can(unsigned count) {
        std::array<canfd_frame, kMaxCan> frames{};
        std::array<iovec, kMaxCan> parts{};
        std::array<mmsghdr, kMaxCan> messages{};
        for (unsigned k = 0; k < count; ++k, ++n_can_) {
            frames[k].can_id = 0x1ABCDE0u | CAN_EFF_FLAG;
            frames[k].len = CANFD_MAX_DLEN;
            const std::uint32_t now_us = sent_us();
            std::memcpy(frames[k].data, &now_us, sizeof now_us);
            frames[k].data[4] = std::uint8_t(n_can_);
            frames[k].data[5] = std::uint8_t(n_can_ >> 8);
            parts[k] = {&frames[k], CANFD_MTU};
            messages[k].msg_hdr.msg_iov = &parts[k];
            messages[k].msg_hdr.msg_iovlen = 1;
        }
        n_refused_ += count - unsigned(std::max(0, ::sendmmsg(can_, messages.data(), count, 0)));
        return count;
    }
    void answer_rtu() {
        std::uint8_t bytes[64];
        const ssize_t n = ::read(rtu_, bytes, sizeof bytes);
        if (n <= 0) return;
        asked_.insert(asked_.end(), bytes, bytes + n);
        for (; asked_.size() >= 8; asked_.erase(asked_.begin(), asked_.begin() + 8)) {
            std::vector<std::uint8_t> answer{asked_[0], asked_[1], std::uint8_t(2 * asked_[5])};
            for (unsigned k = 0; k < asked_[5]; ++k)
                answer.insert(answer.end(), {std::uint8_t(n_rtu_ >> 8), std::uint8_t(n_rtu_)});
            const std::uint16_t crc = modbus_crc(answer);
            answer.insert(answer.end(), {std::uint8_t(crc & 0xFF), std::uint8_t(crc >> 8)});
            if (::write(rtu_, answer.data(), answer.size()) != ssize_t(answer.size())) ++n_refused_;
            ++n_rtu_;
        }
    }

    int uart_, rtu_, can_;
    double uart_Hz_, can_Hz_;
    std::vector<std::uint8_t> asked_;
    unsigned n_uart_ = 0, n_can_ = 0, n_rtu_ = 0, n_refused_ = 0;
    std::uint64_t worst_late_ns_ = 0;
};

}  // namespace

int main(int count, char** words) try {
    if (count != 7) throw std::runtime_error("usage: link_feeder SECONDS UART RTU INTERFACE UART_HZ CAN_HZ");
    Feeder feeder(words);
    std::printf("ready\n");
    std::fflush(stdout);
    feeder.answer_only();  // until the daemon has opened its links
    feeder.run(std::stod(words[1]));
    feeder.answer_only();  // until the counters were read
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "link_feeder: %s\n", error.what());
    return 1;
}
