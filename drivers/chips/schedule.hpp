// Schedules the chips of one bus: the chip that is due first is served first. A faulty chip costs the others only the
// time of its transfers; a fault of the bus affects all of them.
#pragma once
#include <string>
#include <vector>

#include "drivers/chips/station.hpp"

namespace tactiled {

class Schedule {
public:
    explicit Schedule(I2cBus& bus) noexcept : bus_(bus), muxes_(bus) {}

    // setup
    void add(std::string name, std::unique_ptr<Chip> chip, Place place, std::uint16_t device, LinkCounts& counts,
             ReadyLine* ready = nullptr, Selector* selector = nullptr);

    // Configures the chips within half a second; read() continues with the rest. Returns "" or the fault: another
    // chip than configured, no chip at all, or the bus itself. setup
    [[nodiscard]] std::string open();

    // The same as Driver::read(). rt: blocks on the bus
    [[nodiscard]] Status read(Frame& frame, int timeout_ms) noexcept;

private:
    Station& first_due() noexcept;
    // Waits until `t_ns`, or until an edge, after which another station may be due first. rt: blocks until then
    void wait_until(std::uint64_t t_ns) noexcept;

    I2cBus& bus_;
    Muxes muxes_;
    std::vector<Station> stations_;
};

}  // namespace tactiled
