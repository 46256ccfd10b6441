// GPIO lines, through libgpiod 1.x (gpio_v1.cpp) or 2.x (gpio_v2.cpp), whichever is installed. The user of a line
// reopens it after its chip was removed, as the node reopens a link.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace tactiled {

struct GpioName {
    std::string chip;  // label, name or path: "pinctrl-bcm2711", "gpiochip0", "/dev/gpiochip0"
    std::string line;  // name, or offset: "DRDY", "17"
};

struct GpioLine;  // a requested line, which its destructor releases: gpio_v1.cpp or gpio_v2.cpp
struct GpioRelease {
    void operator()(GpioLine* line) const noexcept;
};
using HeldGpioLine = std::unique_ptr<GpioLine, GpioRelease>;

// A line with edges to wait for: data ready.
class GpioEdges {
public:
    enum class Edge { rising, falling };
    enum class Wait { edge, timeout, disconnected };

    // Requests the line. Returns "" on success, else the fault and the remedy. setup; may allocate
    [[nodiscard]] std::string open(const GpioName& name, Edge edge);
    void close() noexcept { held_.reset(); }

    // Waits for an edge and takes all edges that have occurred. `t_ns` is the timestamp of the newest one,
    // CLOCK_MONOTONIC, taken in the interrupt; 0 if newer ones may have been lost. `edges` is their number. An edge
    // can be missed: after `timeout` the device is read anyway. If the chip is removed, the wait ends at its time
    // limit at the latest.
    // rt: blocks for at most `timeout_ms`; ppoll and read
    [[nodiscard]] Wait wait_edge(int timeout_ms, std::uint64_t& t_ns, std::uint32_t& edges) noexcept;
    // Returns a descriptor that is readable when an edge waits, for polling with others; -1 if not open. rt: wait-free
    [[nodiscard]] int fd() const noexcept;
    // Returns 0 or 1, or -1 if the chip was removed, for a line that is used as a level. rt: one ioctl
    [[nodiscard]] int level() const noexcept;

private:
    HeldGpioLine held_;
};

// An output line: select of a multiplexer, reset, signal to another machine.
class GpioOutput {
public:
    // Requests the line, driven high or low from the first moment. setup; may allocate
    [[nodiscard]] std::string open(const GpioName& name, bool high);
    // Releases the line. The chip decides which level it then has; many keep the last one.
    void close() noexcept { held_.reset(); }
    // Sets the level. Returns false if the chip was removed. rt: one ioctl
    [[nodiscard]] bool set(bool high) noexcept;

private:
    HeldGpioLine held_;
};

inline constexpr const char* kGpioConsumer = "tactiled";
// Returns the line's offset if its name consists of digits only.
std::optional<unsigned> gpio_offset(const GpioName& name);
// Returns "GPIO line "DRDY" of chip "gpiochip0": the error and the remedy"; without a chip, the text concerns the
// chip.
std::string gpio_refusal(const GpioName& name, bool has_chip, int error);

}  // namespace tactiled
