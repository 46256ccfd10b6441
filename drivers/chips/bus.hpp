// The seam between chips and whatever carries their bytes: the kernel's bus in the daemon, model chips in virtual time in
// tests. A chip knows registers and no Linux.
#pragma once
#include <cstdint>
#include <span>

namespace tactiled {

enum class Answer : std::uint8_t {
    ok,
    absent,       // nobody acknowledged the address
    failed,       // lost arbitration, a byte not taken: the bus works
    timeout,      // the bus hangs: nothing on it can be read
    disconnected  // the adapter vanished
};

class I2cBus {
public:
    static constexpr std::size_t kMaxBytes = 32;  // a transfer and direction: what SMBus block transfers carry

    virtual ~I2cBus() = default;

    // Writes `out` to the chip at `address`, then, after a repeated start, reads `in`: without a STOP in between, at which
    // some chips forget the register. `out` has a byte at least; `in` may be empty.
    // rt: blocks on the bus, for as long as the adapter's time-out where the bus hangs
    [[nodiscard]] virtual Answer transfer(std::uint8_t address, std::span<const std::uint8_t> out,
                                          std::span<std::uint8_t> in) noexcept = 0;

    // CLOCK_MONOTONIC, or the test's. rt: wait-free
    [[nodiscard]] virtual std::uint64_t now_ns() const noexcept = 0;
    // rt: blocks until then, or until a chip's line has an edge
    virtual void wait_until(std::uint64_t t_ns) noexcept = 0;
};

// A chip's own line on which it says that a conversion has ended.
class ReadyLine {
public:
    virtual ~ReadyLine() = default;
    // Takes the edges that are there; false where there is none. `t_ns` is the newest one's stamp, 0 where it is not known.
    // rt: two system calls, and one an edge
    [[nodiscard]] virtual bool take(std::uint64_t& t_ns) noexcept = 0;
};

// An analog switch in front of a converter's input, which its lines turn to one of several electrodes.
class Selector {
public:
    virtual ~Selector() = default;
    // False where it cannot be told any more what is selected. rt: a system call a line
    [[nodiscard]] virtual bool select(unsigned electrode) noexcept = 0;
};

}  // namespace tactiled
