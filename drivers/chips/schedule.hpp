// Schedule of the chips: all chips of one bus, the one that is due first first. What a chip does wrong costs the others the
// time of its transfers, no more; what the bus does wrong is everybody's.
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

    // Sets up what can be within half a second; the rest goes on in read(). "", or what is wrong: another chip than
    // configured, no chip at all, or the bus itself. setup
    [[nodiscard]] std::string open();

    // The same as Driver::read(). rt: blocks on the bus
    [[nodiscard]] Status read(Frame& frame, int timeout_ms) noexcept;

private:
    Station& first_due() noexcept;
    // Or until an edge, after which another station may be due first. rt: blocks until then
    void wait_until(std::uint64_t t_ns) noexcept;

    I2cBus& bus_;
    Muxes muxes_;
    std::vector<Station> stations_;
};

}  // namespace tactiled
