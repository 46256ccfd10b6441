// A driver turns one link into frames. Thread, ring, retry, reopening, counters in shared memory and quality belong to
// node/; a driver opens, fills one frame at a time, and closes. To add one: drivers/README.md.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "config/options.hpp"
#include "drivers/frame.hpp"
#include "tactiled/layout.h"

namespace tactiled {

enum class Status {
    frame,         // `frame` was filled
    timeout,       // nothing complete arrived in time: call again
    disconnected,  // the device vanished: close(), then open() after a pause
};

// What a link counts; the index is enum tactiled_link_count. Written by the driver's thread only; the node copies it
// out. Counters belong to the driver object and survive close() and open().
struct LinkCounts {
    std::uint32_t count[TACTILED_LINK_COUNTS] = {};
    std::uint32_t& operator[](tactiled_link_count kind) noexcept { return count[kind]; }
    std::uint32_t operator[](tactiled_link_count kind) const noexcept { return count[kind]; }
};

class Driver {
public:
    virtual ~Driver() = default;

    // Opens the device. Returns "" when it is open, else what is wrong and what would mend it, for the log.
    // Never throws. rt: not in the loop; may allocate and block for up to a second
    [[nodiscard]] virtual std::string open() = 0;

    // Fills `frame` with the next reading; frames already received come at once, one a call, in order.
    // rt: blocks on the link, for at most `timeout_ms`; no allocation, no lock, no system call but waiting for its device,
    // reading and asking it (tests/guard lists them)
    [[nodiscard]] virtual Status read(Frame& frame, int timeout_ms) noexcept = 0;

    // rt: not in the loop; may be called when not open
    virtual void close() noexcept = 0;

    // True when another frame is already complete: read() would return it without a system call.
    // rt: wait-free
    [[nodiscard]] virtual bool has_more() const noexcept { return false; }

    // Whether noise moves every number of `device` in every reading, so that many equal ones come of a fault. setup
    [[nodiscard]] virtual bool is_noisy(std::uint16_t /*device*/) const { return false; }

    LinkCounts counts;
};

// One kind of driver. An entry object stands at the foot of the driver's file and links itself into a list, so that a
// new driver is one new file and one line in drivers/CMakeLists.txt.
struct DriverEntry {
    std::string_view name;  // as in `driver = "uart"`
    // Reads the driver's own keys of a [[link]] table. Errors go to the options' Problems; never throws SetupError itself.
    std::unique_ptr<Driver> (*make)(Options& options);
    const DriverEntry* next;

    DriverEntry(std::string_view name_, std::unique_ptr<Driver> (*make_)(Options&)) noexcept;
};

// nullptr where no driver has that name. setup
const DriverEntry* find_driver(std::string_view name) noexcept;
std::vector<std::string> driver_names();

}  // namespace tactiled
