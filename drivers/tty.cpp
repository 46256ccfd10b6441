#include "drivers/tty.hpp"

#include <asm/termbits.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/serial.h>
#include <linux/tty_flags.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "drivers/descriptor.hpp"

namespace tactiled {
namespace {

constexpr unsigned kFirstPty = 136, kLastPty = 143;  // major numbers, Documentation/admin-guide/devices.txt

const char* remedy(int error, bool relative) {
    switch (error) {
        case ENOENT:
            if (relative) return " (a relative path is seen from the folder of the program's start: write the full path)";
            return " (is it plugged in? ls /dev/serial/by-id)";
        case EACCES: return " (join its group, usually: adduser YOU dialout, and log in again)";
        case EBUSY: return " (another program has it open, such as a daemon of tactiled; who: fuser PATH)";
        case ENXIO:
        case EIO: return " (the device behind the name is disconnected)";
        case ENOTTY: return " (this is no serial port)";
        default: return "";
    }
}

}  // namespace

int open_tty(const std::string& path, const TtySettings& wanted, std::string& why) {
    using Parity = TtySettings::Parity;
    const unsigned baud = wanted.baud;
    Descriptor fd(::open(path.c_str(), (wanted.answers ? O_RDWR : O_RDONLY) | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    const auto fail = [&](const char* what) {
        const int error = errno;
        why = fmt::format("{}: {}{}{}", path, what, std::strerror(error), remedy(error, !path.starts_with('/')));
        return -1;
    };
    if (fd < 0) return fail("");
    termios2 settings{};
    if (::ioctl(fd, TCGETS2, &settings) != 0) return fail("");
    // A pseudo terminal would keep the flag after this close, and afterwards only root could open it.
    struct stat file {};
    const bool is_pty = ::fstat(fd, &file) == 0 && major(file.st_rdev) >= kFirstPty && major(file.st_rdev) <= kLastPty;
    if (!is_pty && ::ioctl(fd, TIOCEXCL) != 0) return fail("exclusive use: ");
    if (::flock(fd, LOCK_EX | LOCK_NB) != 0) {  // root can open an exclusive tty: this lock keeps two daemons apart
        errno = EBUSY;
        return fail("");
    }
    // a byte with wrong parity reads as 0, so the frame's checksum fails
    settings.c_iflag = wanted.parity == Parity::none ? 0 : INPCK;
    settings.c_oflag = 0;
    settings.c_lflag = 0;
    // no HUPCL: closing must not reset an Arduino
    settings.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
    if (wanted.parity != Parity::none) settings.c_cflag |= PARENB | (wanted.parity == Parity::odd ? PARODD : 0u);
    if (wanted.two_stop_bits) settings.c_cflag |= CSTOPB;
    settings.c_ispeed = settings.c_ospeed = baud;
    settings.c_cc[VMIN] = 1;
    settings.c_cc[VTIME] = 0;
    if (::ioctl(fd, TCSETS2, &settings) != 0) return fail("settings: ");
    // A UART that cannot do the rate accepts the call and uses another rate.
    termios2 got{};
    if (::ioctl(fd, TCGETS2, &got) != 0) return fail("settings: ");
    const unsigned off = got.c_ospeed > baud ? got.c_ospeed - baud : baud - got.c_ospeed;
    if (off > baud / 50) {
        why =
            fmt::format("{}: {} baud was requested, and the port runs at {}: choose another rate", path, baud, got.c_ospeed);
        return -1;
    }
    // USB adapters delay bytes by 16 ms unless configured otherwise. Optional: a pty does not support it.
    serial_struct serial{};
    if (::ioctl(fd, TIOCGSERIAL, &serial) == 0) {
        serial.flags |= ASYNC_LOW_LATENCY;
        (void)::ioctl(fd, TIOCSSERIAL, &serial);
    }
    if (wanted.rs485) {
        serial_rs485 direction{};
        direction.flags = SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND;
        if (::ioctl(fd, TIOCSRS485, &direction) != 0)
            return fail("RS-485 direction (leave rs485 out where the adapter switches by itself): ");
    }
    if (!flush_tty(fd)) return fail("flush: ");
    return fd.release();
}

bool is_local_tty(const std::string& path) noexcept {
    struct stat file {};
    if (::stat(path.c_str(), &file) != 0 || !S_ISCHR(file.st_mode)) return false;
    std::array<char, 64> link{};
    std::array<char, 512> device{};
    std::snprintf(link.data(), link.size(), "/sys/dev/char/%u:%u", unsigned(major(file.st_rdev)),
                  unsigned(minor(file.st_rdev)));
    const ssize_t size = ::readlink(link.data(), device.data(), device.size());
    if (size <= 0) return false;                                     // a pseudo terminal
    const std::string_view where(device.data(), std::size_t(size));  // ../../devices/pci0000:00/.../tty/ttyUSB0
    for (const std::string_view network : {"/virtual/", "vhci", "/bluetooth/", "rfcomm"})
        if (where.find(network) != std::string_view::npos) return false;
    return true;
}

bool flush_tty(int fd) noexcept { return ::ioctl(fd, TCFLSH, TCIFLUSH) == 0; }

bool tty_overruns(int fd, std::uint32_t& count) noexcept {
    serial_icounter_struct counters{};
    if (::ioctl(fd, TIOCGICOUNT, &counters) != 0) return false;
    count = std::uint32_t(counters.overrun) + std::uint32_t(counters.buf_overrun);
    return true;
}

}  // namespace tactiled
