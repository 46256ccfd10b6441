// A tty as the kernel sees it: opening, its settings, its error counters. termios2 and <termios.h> cannot share a
// translation unit, so this is its own.
#pragma once
#include <cstdint>
#include <string>

namespace tactiled {

struct TtySettings {
    unsigned baud = 115200;  // any rate; read back and compared
    enum class Parity { none, odd, even } parity = Parity::none;
    bool two_stop_bits = false;
    bool answers = false;  // opened for writing, too
    bool rs485 = false;    // the kernel's driver switches the direction while it sends
};

// Opens `path` raw with 8 bits, exclusively, and throws away what waited in the kernel: old bytes must not get a new stamp.
// Returns the descriptor, or -1 with `why` and its remedy.
int open_tty(const std::string& path, const TtySettings& settings, std::string& why);

// Bytes that the kernel or the UART has lost since boot, where the driver counts them. Returns false where it does not.
// rt: one ioctl
bool tty_overruns(int fd, std::uint32_t& count) noexcept;

// True where a UART or an adapter of this machine is behind the tty, whose buffers and rate bound the delay. False for a
// pseudo terminal and for a port on a network (USB/IP, Bluetooth, drivers of serial servers): they may hold bytes for any
// time.
bool is_local_tty(const std::string& path) noexcept;

// Throws away what was received and not read, as far as the kernel has it; false where it cannot.
bool flush_tty(int fd) noexcept;

}  // namespace tactiled
