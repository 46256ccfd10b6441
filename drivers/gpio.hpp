// GPIO lines, through libgpiod 1.x (gpio_v1.cpp) or 2.x (gpio_v2.cpp), whichever the machine has. A line's user reopens it
// when its chip is gone, as the node reopens a link.
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

// A line whose edges are waited for: data ready.
class GpioEdges {
public:
    enum class Edge { rising, falling };
    enum class Wait { edge, timeout, disconnected };

    GpioEdges();
    ~GpioEdges();
    // Returns "" when the line is held, else the fault and the remedy. setup; may allocate
    [[nodiscard]] std::string open(const GpioName& name, Edge edge);
    void close() noexcept;

    // Waits for an edge and takes all that are there. `t_ns` is the newest one's stamp, CLOCK_MONOTONIC, taken in the
    // interrupt, 0 where newer ones may have been lost; `edges` how many there were. An edge can be missed: after `timeout`
    // the device is asked all the same. A chip that goes away ends a wait at its time-out at the latest.
    // rt: blocks for at most `timeout_ms`; ppoll and read
    [[nodiscard]] Wait wait_edge(int timeout_ms, std::uint64_t& t_ns, std::uint32_t& edges) noexcept;
    // Readable while an edge waits: to be polled among others. -1 when not open. rt: wait-free
    [[nodiscard]] int fd() const noexcept;
    // 0 or 1, -1 where the chip is gone: for a line that is a level rather than an edge. rt: one ioctl
    [[nodiscard]] int level() const noexcept;

private:
    struct Held;
    std::unique_ptr<Held> held_;
};

// A line that is driven: a multiplexer's select, a reset, a signal to another machine.
class GpioOutput {
public:
    GpioOutput();
    GpioOutput(GpioOutput&&) noexcept;
    ~GpioOutput();
    // Driven high or low from the first moment on. setup; may allocate
    [[nodiscard]] std::string open(const GpioName& name, bool high);
    // Lets go of the line. What level it then has is the chip's affair: many keep the last.
    void close() noexcept;
    // False where the chip is gone. rt: one ioctl
    [[nodiscard]] bool set(bool high) noexcept;

private:
    struct Held;
    std::unique_ptr<Held> held_;
};

// ---- for both back ends ----

inline constexpr const char* kGpioConsumer = "tactiled";
// The line's offset, where its name is nothing but digits.
std::optional<unsigned> gpio_offset(const GpioName& name);
// "GPIO line "DRDY" of chip "gpiochip0": what the error is, and what a user can do about it"; without a chip, of that.
std::string gpio_refusal(const GpioName& name, bool has_chip, int error);

}  // namespace tactiled
