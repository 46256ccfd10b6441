// /dev/i2c-N as the kernel offers it: plain I2C where the adapter can, else SMBus block transfers.
#pragma once
#include <poll.h>

#include <string>
#include <vector>

#include "drivers/chips/bus.hpp"

namespace tactiled {

class I2cDevice final : public I2cBus {
public:
    ~I2cDevice() override { close(); }

    // "", or the fault and the remedy. `timeout_ms` 0 leaves the adapter's own, which all users of it share.
    // setup
    [[nodiscard]] std::string open(const std::string& path, int timeout_ms);
    void close() noexcept;

    Answer transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept override;
    std::uint64_t now_ns() const noexcept override;
    void wait_until(std::uint64_t t_ns) noexcept override;

    // These end a wait when they are readable, until they are gone. setup
    void watch(std::vector<int> fds);
    // rt: bounded by the number of lines
    void forget(int fd) noexcept;

private:
    [[nodiscard]] int carry_out(std::uint8_t address, std::span<const std::uint8_t> out,
                                std::span<std::uint8_t> in) noexcept;
    [[nodiscard]] int smbus(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept;
    [[nodiscard]] Answer classify(int error, std::uint64_t began_ns) noexcept;

    std::vector<pollfd> watched_;
    int fd_ = -1;
    int presence_fd_ = -1;  // the adapter's `name` in sysfs: can be read for as long as the adapter is there
    bool is_plain_ = true;
    unsigned n_hard_ = 0;  // errors in a row that are no missing acknowledge
};

}  // namespace tactiled
