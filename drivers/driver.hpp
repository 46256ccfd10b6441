// A driver turns one link into frames. Thread, ring, retry, reopening, counters in shared memory and quality belong to
// node/; a driver opens, fills one frame at a time, and closes. To add one: drivers/README.md.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "config/options.hpp"
#include "config/registry.hpp"
#include "drivers/frame.hpp"
#include "drivers/taxels.hpp"
#include "drivers/wire/stream_age.hpp"
#include "tactiled/layout.h"

namespace tactiled {

enum class Status {
    frame,         // `frame` was filled
    timeout,       // no complete frame in time: call again
    disconnected,  // the device is disconnected: close(), then open() after a pause
};

// Counters of a link, indexed by enum tactiled_link_count. Only the driver's thread writes them, and the node copies
// them. Counters belong to the driver object and survive close() and open().
struct LinkCounts {
    std::uint32_t count[TACTILED_LINK_COUNTS] = {};
    std::uint32_t& operator[](tactiled_link_count kind) noexcept { return count[kind]; }
    std::uint32_t operator[](tactiled_link_count kind) const noexcept { return count[kind]; }
};

class Driver {
public:
    virtual ~Driver() = default;

    // Opens the device. Returns "" on success, else the fault and the remedy, for the log. Never throws. rt: not in
    // the loop; may allocate and block for up to a second
    [[nodiscard]] virtual std::string open() = 0;

    // Fills `frame` with the next reading. Frames that were already received are returned immediately, one per call, in
    // order.
    // rt: blocks on the link, for at most `timeout_ms`; no allocation, no lock; the only system calls wait for,
    // read and query the device (tests/guard lists them)
    [[nodiscard]] virtual Status read(Frame& frame, int timeout_ms) noexcept = 0;

    // rt: not in the loop; may be called when not open
    virtual void close() noexcept = 0;

    // The same for a stream that is opened again at once: the device is not told to stop. rt: not in the loop
    virtual void interrupt() noexcept { close(); }

    // True if another frame is already complete: read() would return it without a system call.
    // rt: wait-free
    [[nodiscard]] virtual bool has_more() const noexcept { return false; }

    // The shape of the arrays that this link carries, from its keys. setup
    [[nodiscard]] virtual TaxelShape taxel_shape() const noexcept { return {}; }
    // The taxels of the last frame, valid until the next call of read() or has_more(). A frame with channels has none.
    // rt: wait-free
    [[nodiscard]] virtual Taxels taxels() const noexcept { return {}; }

    // True if read() with a time limit of 0 never waits, so that one thread may read several links. setup
    [[nodiscard]] virtual bool can_poll() const noexcept { return false; }

    // Describes the path of the frames. The default is for a driver that dates its frames itself, from a bus or a
    // device of this machine. Called after open().
    // rt: wait-free
    [[nodiscard]] virtual Route route() const noexcept { return {}; }

    // Text for `tactilectl check` and `doctor`: the proof of age that the frames will have, and a change of the format that
    // the user should make ("" = none). setup
    [[nodiscard]] virtual std::string freshness() const {
        return route().path == Route::Path::polled ? "request (each frame answers a request)"
                                                   : "cable (a bus of this machine)";
    }
    [[nodiscard]] virtual std::string advice() const { return ""; }

    // Returns what the user can do so that frames prove their age on this path, for a message. setup
    [[nodiscard]] virtual std::string proof_advice() const { return "let the device send its time"; }

    // True if noise changes every number of `device` in every reading, so that many equal readings indicate a fault.
    // setup
    [[nodiscard]] virtual bool is_noisy(std::uint16_t /*device*/) const { return false; }

    // Known delay from the middle of the measurement of a channel of `device` to t_ns of the frame, s; 0 if unknown.
    // Channels that are converted successively have different delays. setup
    [[nodiscard]] virtual double delay_s(std::uint16_t /*device*/, std::size_t /*channel*/) const { return 0; }

    LinkCounts counts;
};

// A resource of this machine that a link needs; `tactilectl doctor` checks it.
struct Requirement {
    enum class Kind {
        file,               // must exist, and the daemon's user must be allowed to read and write it
        serial_port,        // a serial port: its adapter should not delay received bytes
        network_interface,  // must exist and be up
        socket_buffer       // a limit of the kernel should allow a socket so many bytes
    } kind;
    std::string name;           // path of the file, name of the interface, or of the limit
    std::string bring_up = "";  // network_interface: the command that sets it up
    std::size_t bytes = 0;      // socket_buffer
};

// One kind of driver. A new driver is one new file, with an entry at its end, and one line in drivers/CMakeLists.txt.
struct DriverEntry {
    std::string_view name;  // name in `driver = "uart"`
    // False if the driver invents or replays its data, which are then always published as simulated. There is no
    // default: simulated data published as measured ones would be worse than the reverse.
    Required<bool> measures;
    // Reads the driver's own keys of a [[link]] table. Errors go to the options' Problems; a driver with an
    // error is never opened. Never throws SetupError itself.
    std::unique_ptr<Driver> (*make)(Options& options);
    // Returns the requirements of the link with these keys, which make() has accepted. nullptr: none. setup
    std::vector<Requirement> (*requirements)(Options& options) = nullptr;
    Registry<DriverEntry> in_list{this};
};

using Drivers = Registry<DriverEntry>;

}  // namespace tactiled
