// The interface between chips and their bus: the kernel's bus in the daemon, model chips in virtual time in tests. A
// chip knows registers and no Linux.
#pragma once
#include <cstdint>
#include <span>

namespace tactiled {

enum class Answer : std::uint8_t {
    ok,
    absent,       // no chip acknowledged the address
    failed,       // lost arbitration, or a byte without acknowledge: the bus works
    timeout,      // the bus hangs: no chip on it can be read
    disconnected  // the adapter was removed
};

class I2cBus {
public:
    static constexpr std::size_t kMaxBytes = 32;  // per transfer and direction: the maximum of SMBus block transfers

    virtual ~I2cBus() = default;

    // Writes `out` to the chip at `address`, then, after a repeated start, reads `in`. There is no STOP in between, because
    // some chips forget the register at a STOP. `out` has at least one byte; `in` may be empty.
    // rt: blocks on the bus, at most for the adapter's time-out
    [[nodiscard]] virtual Answer transfer(std::uint8_t address, std::span<const std::uint8_t> out,
                                          std::span<std::uint8_t> in) noexcept = 0;

    // Time on CLOCK_MONOTONIC, or of the test. rt: wait-free
    [[nodiscard]] virtual std::uint64_t now_ns() const noexcept = 0;
    // rt: blocks until then, or until a chip's line has an edge
    virtual void wait_until(std::uint64_t t_ns) noexcept = 0;
};

// The data-ready line of a chip, which signals the end of a conversion.
class ReadyLine {
public:
    virtual ~ReadyLine() = default;
    // Takes the edges that have occurred. Returns false if there are none. `t_ns` is the timestamp of the newest edge, 0 if
    // unknown.
    // rt: two system calls, and one per edge
    [[nodiscard]] virtual bool take(std::uint64_t& t_ns) noexcept = 0;
};

// An analog switch in front of a converter's input. GPIO lines connect it to one of several electrodes.
class Selector {
public:
    virtual ~Selector() = default;
    // Returns false if the state of the switch is unknown. rt: a system call per line
    [[nodiscard]] virtual bool select(unsigned electrode) noexcept = 0;
};

}  // namespace tactiled
