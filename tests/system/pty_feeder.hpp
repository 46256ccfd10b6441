// A device behind a pty, for programs that must know the sent data: binary frames of 8 channels whose numbers follow
// from the sequence number, so that a reader can distinguish a torn, mixed or wrong sample from a right one.
#pragma once
#include <fcntl.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>

#include "drivers/wire/cobs_frame.hpp"
#include "tactiled/layout.h"

namespace tactiled::testing {

inline constexpr int kFeederChannels = 8;

// Returns channel k of frame `sequence` (modulo 65536): 20 bits, so that 24-bit channels never reach their saturation
// limits.
inline double fed_count(std::uint32_t sequence, int k) {
    return double(((sequence & 0xFFFF) * 2654435761u + std::uint32_t(k) * 40503u) >> 12) - 524288;
}

// A raw pty whose slave is reachable as `link` ("" = no link).
class Pty {
public:
    explicit Pty(const std::string& link) : link_(link) {
        char name[128];
        if (::openpty(&master_, &slave_, name, nullptr, nullptr) != 0) std::abort();
        termios raw{};
        ::tcgetattr(slave_, &raw);
        ::cfmakeraw(&raw);
        ::tcsetattr(slave_, TCSANOW, &raw);
        ::fcntl(master_, F_SETFL, O_NONBLOCK);
        ::unlink(link.c_str());
        if (!link.empty() && ::symlink(name, link.c_str()) != 0) std::abort();
    }
    ~Pty() {
        if (!link_.empty()) ::unlink(link_.c_str());
        ::close(slave_);
        ::close(master_);
    }
    Pty(const Pty&) = delete;
    Pty& operator=(const Pty&) = delete;
    int master() const { return master_; }
    int slave() const { return slave_; }  // kept open: a daemon that is killed leaves the port unchanged

private:
    std::string link_;
    int master_ = -1, slave_ = -1;
};

inline std::size_t encode_fed(std::uint32_t sequence, std::span<std::uint8_t, kCobsMaxEncoded> out) {
    Frame frame;
    frame.sequence = sequence;
    frame.n_channels = kFeederChannels;
    for (int k = 0; k < kFeederChannels; ++k) frame.channel[std::size_t(k)] = fed_count(sequence, k);
    return encode_cobs(frame, 24, out);
}

// Returns true if the forces of a sample are its frame's first three channels in units of 0.001 N, exactly.
inline bool is_as_fed(const tactiled_sample& s) {
    for (int i = 0; i < 3; ++i)
        if (s.raw_force_S_N[i] != 0.001 * fed_count(s.device_sequence, i) || s.force_S_N[i] != s.raw_force_S_N[i])
            return false;
    return true;
}

// Writes configuration and calibration of a daemon that reads such a device at FOLDER/dev.
inline void write_fed_config(const std::string& folder, const std::string& node, const std::string& listen, int stale_ms) {
    std::ofstream(folder + "/fed.toml") << R"(format = 1
model = "generic"
method = "matrix"
contact_model = "unknown"
serial = "fed"
date = "2026-01-01"
channels = ["c1", "c2", "c3", "c4", "c5", "c6", "c7", "c8"]
channel_unit = "counts"
zero = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
components = ["fx", "fy", "fz"]
matrix = [[0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0]]
sd = [0.01, 0.01, 0.01]
full_scale = [500.0, 500.0, 500.0]
)";
    std::ofstream(folder + "/tactiled.toml")
        << "[node]\nname = \"" << node << "\"\ncontrol = \"" << folder << "/control.sock\"\n\n"
        << "[[link]]\nname = \"usb0\"\ndriver = \"uart\"\ndevice = \"" << folder
        << "/dev\"\nbaud = 921600\nformat = \"cobs\"\n\n[[sensor]]\nname = \"left\"\nlink = \"usb0\"\n"
        << "model = \"generic\"\ncalibration = \"fed.toml\"\nstale_ms = " << stale_ms << "\n\n[modbus]\nlisten = \""
        << listen << "\"\n";
}

}  // namespace tactiled::testing
