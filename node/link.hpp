// One link of the node: its driver, and the ring through which its thread hands frames to the pipeline.
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/driver.hpp"
#include "node/lending.hpp"
#include "node/link_age.hpp"
#include "node/ring.hpp"
#include "node/taxel_store.hpp"
#include "tactiled/layout.h"

namespace tactiled {

// Counts the frames that a full ring refused, by device, until the next frame of the device reports the count in `lost`.
class RefusedFrames {
public:
    // rt: bounded by the number of sensors
    void add(std::uint16_t device, std::uint32_t frames) noexcept {
        for (auto& entry : entries_)
            if (entry.frames == 0 || entry.device == device) {
                entry.device = device;
                entry.frames += frames;
                return;
            }
    }
    // Returns the count of `device`, which restarts at 0. rt: bounded by the number of sensors
    [[nodiscard]] std::uint32_t take(std::uint16_t device) noexcept {
        std::uint32_t frames = 0;
        for (auto& entry : entries_)
            if (entry.device == device) frames += std::exchange(entry.frames, 0);
        return frames;
    }

private:
    struct Entry {
        std::uint16_t device = 0;
        std::uint32_t frames = 0;
    };
    std::array<Entry, TACTILED_MAX_SENSORS> entries_{};
};

struct Link {
    static constexpr std::size_t kRingFrames = 256;  // 60 ms at 4 kHz, 0.25 s at 1 kHz

    struct Binding {  // device of this link -> sensor of the node
        std::uint16_t device;
        std::uint16_t sensor;
    };

    // Constant while the threads run.
    std::string name;
    std::uint32_t index = 0;  // index in the segment's directory
    std::unique_ptr<Driver> driver;
    std::vector<Binding> bindings;

    // Written by the link's thread, read by the pipeline.
    Ring<Frame> ring{kRingFrames};
    TaxelStore taxels;  // the taxels of the frames in the ring
    std::atomic<bool> connected{false};
    std::atomic<std::uint32_t> ring_full{0};  // frames that the ring refused since the start

    // The driver is read by the link's own thread, or lent to the thread that reads several links (shared_links.hpp).
    Lending lending;
    bool is_present = true;               // set by the reader that gives the link back
    std::atomic<std::uint64_t> reads{0};  // number of bursts; written by the reader

    // Used by the reader only.
    std::uint64_t read_ns = 0, read_interval_ns = UINT64_MAX;  // end of the last burst, and time between the last two
    // The device was opened at `now_ns`, and no frame has been read since. `is_wanted`: it was closed to prove the age.
    // rt: wait-free
    void opened(std::uint64_t now_ns, bool is_wanted) noexcept {
        ++driver->counts[TACTILED_LINK_OPENED];
        age.opened(now_ns, is_wanted);
        if (!std::exchange(is_proving, false)) ++stream;
    }

    // Used by the reader only, except LinkAge::proof() and bound_ns().
    LinkAge age;
    bool is_proving = false;   // the link was closed only to prove the age of its frames
    std::uint32_t stream = 0;  // number of the stream: the openings, except those that prove the age
    RefusedFrames refused;
    Frame spare;  // receives the frame that the ring refuses

    // Written by the pipeline: an object is held, and an opening may wait.
    std::atomic<bool> is_busy{false};

    // Used by the pipeline only.
    bool was_connected = false;   // `connected`, as read before the ring was last emptied
    std::uint32_t unbound = 0;    // frames that belong to no sensor
    std::uint64_t delivered = 0;  // frames, with or without a sensor
};

}  // namespace tactiled
