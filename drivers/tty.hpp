// A tty of the kernel: opening, settings and error counters. termios2 and <termios.h> cannot share a translation
// unit, so this file is separate.
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

// Opens `path` raw with 8 bits, exclusively, and discards the bytes that waited in the kernel, so that old bytes get
// no new timestamp. Returns the descriptor, or -1 with the reason and the remedy in `why`.
int open_tty(const std::string& path, const TtySettings& settings, std::string& why);

// Reads the number of bytes that the kernel or the UART has lost since boot. Returns false if the driver does not
// count them.
// rt: one ioctl
bool tty_overruns(int fd, std::uint32_t& count) noexcept;

// Returns true if a UART or an adapter of this machine is behind the tty, so that its buffers and rate bound the
// delay. Returns false for a pseudo terminal and for a port on a network (USB/IP, Bluetooth, drivers of serial
// servers): they may delay bytes for any time.
bool is_local_tty(const std::string& path) noexcept;

// Discards the received bytes that were not read, as far as the kernel has them. Returns false if that fails.
bool flush_tty(int fd) noexcept;

}  // namespace tactiled
