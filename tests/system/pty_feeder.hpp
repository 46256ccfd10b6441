// A device behind a pty, for tests that must know what it sent: binary frames of 8 channels whose numbers follow from the
// sequence number, written at a rate by a thread of its own.
#pragma once
#include <fcntl.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>

namespace tactiled::testing {

inline constexpr int kFeederChannels = 8;

// What channel k of frame number `sequence` carries: 20 bits, so that 24-bit channels never meet their rails.
inline std::int32_t fed_count(std::uint64_t sequence, int k) {
    return std::int32_t((sequence * 2654435761u + std::uint64_t(k) * 40503u) & 0xFFFFF) - 0x80000;
}

// The master of a raw pty whose slave is reachable as `link`.
class Pty {
public:
    explicit Pty(const std::string& link) : link_(link) {
        int slave = -1;
        char name[128];
        if (::openpty(&master_, &slave, name, nullptr, nullptr) != 0) std::abort();
        termios raw{};
        ::tcgetattr(slave, &raw);
        ::cfmakeraw(&raw);
        ::tcsetattr(slave, TCSANOW, &raw);
        slave_ = slave;  // kept: without any opener a pty's master reads EIO, and its settings are lost
        if (!link.empty()) {
            ::unlink(link.c_str());
            if (::symlink(name, link.c_str()) != 0) std::abort();
        }
    }
    ~Pty() {
        if (!link_.empty()) ::unlink(link_.c_str());
        ::close(slave_);
        ::close(master_);
    }
    Pty(const Pty&) = delete;
    Pty& operator=(const Pty&) = delete;
    int master() const { return master_; }
    int slave() const { return slave_; }

private:
    std::string link_;
    int master_ = -1, slave_ = -1;
};

}  // namespace tactiled::testing
