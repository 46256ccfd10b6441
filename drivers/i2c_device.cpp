#include "drivers/i2c_device.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "drivers/clock.hpp"

namespace tactiled {
namespace {

// A transfer of 35 bytes takes less than this at 10 kHz; the time limits of adapters are 0.1 s to 2 s.
constexpr std::uint64_t kHangNs = 90'000'000;
constexpr unsigned kMaxHard = 8;  // errors in a row after which the adapter is opened again

std::string remedy(int error, const std::string& path) {
    switch (error) {
        case ENOENT: return "no such bus: load the module i2c-dev, plug the adapter in, see i2cdetect -l";
        case EACCES: return "no right to use it: add the daemon's user to the group of the file (ls -l " + path + ")";
        case ENXIO: return "the adapter is disconnected; plug it in again";
        default: return std::strerror(error);
    }
}

}  // namespace

std::string I2cDevice::open(const std::string& path, int timeout_ms) {
    close();
    fd_.reset(::open(path.c_str(), O_RDWR | O_CLOEXEC));
    if (fd_ < 0) return fmt::format("{}: {}", path, remedy(errno, path));
    unsigned long functions = 0;
    if (::ioctl(fd_, I2C_FUNCS, &functions) != 0)
        return fmt::format("{}: is no I2C bus; should be such as /dev/i2c-1", path);
    is_plain_ = (functions & I2C_FUNC_I2C) != 0;
    constexpr unsigned long kBlocks = I2C_FUNC_SMBUS_I2C_BLOCK | I2C_FUNC_SMBUS_BYTE;
    if (!is_plain_ && (functions & kBlocks) != kBlocks)
        return fmt::format("{}: this adapter can neither plain I2C nor SMBus I2C block transfers; take another", path);
    // In units of 10 ms. The adapter's own value stays if none is configured, because it affects every user of the
    // adapter.
    if (timeout_ms > 0 && ::ioctl(fd_, I2C_TIMEOUT, (unsigned long)((timeout_ms + 9) / 10)) != 0)
        return fmt::format("{}: timeout_ms = {} was refused: {}", path, timeout_ms, std::strerror(errno));
    struct stat status {};
    if (::fstat(fd_, &status) == 0) {
        const std::string name = fmt::format("/sys/dev/char/{}:{}/name", major(status.st_rdev), minor(status.st_rdev));
        presence_fd_.reset(::open(name.c_str(), O_RDONLY | O_CLOEXEC));
    }
    n_hard_ = 0;
    return "";
}

void I2cDevice::close() noexcept {
    fd_.reset();
    presence_fd_.reset();
}

std::uint64_t I2cDevice::now_ns() const noexcept { return tactiled::now_ns(); }

void I2cDevice::wait_until(std::uint64_t t_ns) noexcept {
    const std::uint64_t now = now_ns();
    if (t_ns <= now) return;
    const timespec wait{long((t_ns - now) / 1'000'000'000), long((t_ns - now) % 1'000'000'000)};
    if (::ppoll(watched_.data(), watched_.size(), &wait, nullptr) <= 0) return;
    for (pollfd& line : watched_)
        if ((line.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) line.fd = -1;  // the GPIO chip was removed
}

void I2cDevice::watch(const std::vector<int>& fds) {
    watched_.clear();
    for (const int fd : fds) watched_.push_back({fd, POLLIN, 0});
}

void I2cDevice::forget(int fd) noexcept {
    for (pollfd& line : watched_)
        if (line.fd == fd) line.fd = -1;
}

Answer I2cDevice::transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept {
    const std::uint64_t began_ns = now_ns();
    const int error = is_plain_ ? carry_out(address, out, in) : smbus(address, out, in);
    if (error == 0) {
        n_hard_ = 0;
        return Answer::ok;
    }
    return classify(error, began_ns);
}

// Sends one message or two. Returns 0 or errno.
int I2cDevice::carry_out(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept {
    i2c_msg messages[2] = {{address, 0, std::uint16_t(out.size()), const_cast<std::uint8_t*>(out.data())},
                           {address, I2C_M_RD, std::uint16_t(in.size()), in.data()}};
    const unsigned n = in.empty() ? 1 : 2;
    i2c_rdwr_ioctl_data all{messages, n};
    const int done = ::ioctl(fd_, I2C_RDWR, &all);
    return done == int(n) ? 0 : done < 0 ? errno : EIO;
}

int I2cDevice::smbus(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept {
    i2c_smbus_data data{};
    i2c_smbus_ioctl_data call{I2C_SMBUS_WRITE, out[0], I2C_SMBUS_I2C_BLOCK_DATA, &data};
    if (::ioctl(fd_, I2C_SLAVE, (unsigned long)(address)) != 0) return errno;
    if (!in.empty()) {
        call.read_write = I2C_SMBUS_READ;
        data.block[0] = std::uint8_t(in.size());
    } else if (out.size() == 1) {
        call.size = I2C_SMBUS_BYTE;
    } else {
        data.block[0] = std::uint8_t(out.size() - 1);
        std::copy(out.begin() + 1, out.end(), data.block + 1);
    }
    if (::ioctl(fd_, I2C_SMBUS, &call) != 0) return errno;
    if (in.empty()) return 0;
    if (data.block[0] != in.size()) return EIO;
    std::copy_n(data.block + 1, in.size(), in.begin());
    return 0;
}

// A missing acknowledge is ENXIO with most adapters, EREMOTEIO with bcm2835, designware and tegra.
Answer I2cDevice::classify(int error, std::uint64_t began_ns) noexcept {
    if (error == ENXIO || error == EREMOTEIO) return Answer::absent;
    if (error == EAGAIN) return Answer::failed;
    // A removed adapter returns EIO permanently, and the kernel does not recognise another USB device until this one
    // is closed.
    char byte;
    if (error == ENODEV || presence_fd_ < 0 || ::read(presence_fd_, &byte, 1) < 0 || ++n_hard_ >= kMaxHard)
        return Answer::disconnected;
    if (error == ETIMEDOUT || now_ns() - began_ns >= kHangNs) return Answer::timeout;
    return Answer::failed;  // EIO: with some adapters, a byte without acknowledge
}

}  // namespace tactiled
