// Access to /dev/i2c-N: plain I2C if the adapter supports it, else SMBus block transfers.
#pragma once
#include <poll.h>

#include <string>
#include <vector>

#include "drivers/chips/bus.hpp"
#include "drivers/descriptor.hpp"

namespace tactiled {

class I2cDevice final : public I2cBus {
public:
    // Opens the adapter. Returns "" or the fault and the remedy. `timeout_ms` = 0 leaves the adapter's own limit,
    // which all users of the adapter share. setup
    [[nodiscard]] std::string open(const std::string& path, int timeout_ms);
    void close() noexcept;

    Answer transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept override;
    std::uint64_t now_ns() const noexcept override;
    void wait_until(std::uint64_t t_ns) noexcept override;

    // Sets descriptors that end a wait when they are readable, until they are removed. setup
    void watch(const std::vector<int>& fds);
    // rt: bounded by the number of lines
    void forget(int fd) noexcept;

private:
    [[nodiscard]] int carry_out(std::uint8_t address, std::span<const std::uint8_t> out,
                                std::span<std::uint8_t> in) noexcept;
    [[nodiscard]] int smbus(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept;
    [[nodiscard]] Answer classify(int error, std::uint64_t began_ns) noexcept;

    std::vector<pollfd> watched_;
    Descriptor fd_;
    Descriptor presence_fd_;  // the adapter's `name` in sysfs, readable as long as the adapter exists
    bool is_plain_ = true;
    unsigned n_hard_ = 0;  // consecutive errors other than a missing acknowledge
};

}  // namespace tactiled
