// Checks that the stream of one sensor is alive and plausible, from times and raw numbers only. The model interprets the
// numbers; Sensor makes the published sample.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>

#include "drivers/frame.hpp"
#include "node/quiet_check.hpp"
#include "node/tuning.hpp"
#include "tactiled/layout.h"

namespace tactiled {

class StreamQuality {
public:
    // `tuning` must outlive this object.
    explicit StreamQuality(const Tuning& tuning) : tuning_(&tuning) {}

    // Starts the measurement of times. Call it once, before the first frame. setup
    void start(std::uint64_t now_ns) noexcept { last_frame_ns_ = now_ns; }

    // Continues the counters of `before`, after a discontinuity. With the same channels, dead channels remain dead.
    // rt: bounded by the channels
    void succeed(const StreamQuality& before, bool same_channels) noexcept;

    // Takes a frame that is older than allowed. The sensor has no value until a newer frame arrives. rt: wait-free
    void arrive_late(const Frame& frame) noexcept;
    // Records that the machine was suspended until `now_ns`. Frames with an earlier time count as late. rt: wait-free
    void suspended(std::uint64_t now_ns) noexcept {
        resumed_ns_ = now_ns;
        last_frame_ns_ = 0;
    }
    [[nodiscard]] bool is_late(const Frame& frame) const noexcept {
        return frame.late_ns > tuning_->stale_ns || frame.t_ns < resumed_ns_;
    }
    // Records that the stream delivers. Returns true if this is the first frame after a discontinuity. rt: wait-free
    bool arrive(const Frame& frame) noexcept;
    // Checks the channels of the frame that has just arrived. `usable`: bit k is set if channel k has a number that is not
    // saturated. Sets in `dead` the channels that have no value. Returns reasons. rt: bounded by the channels
    [[nodiscard]] std::uint32_t judge(std::span<const double> raw, std::uint32_t usable, std::uint32_t& dead) noexcept;

    // Returns true if there is a new discontinuity, or its reason has changed. `connected` is the link's state. rt:
    // wait-free
    [[nodiscard]] bool has_discontinuity(bool connected, std::uint64_t now_ns) noexcept;
    // Returns the time by which has_discontinuity() must be called again if nothing else happens: the stream's limit,
    // or the limit of a frame that arrives after `now_ns`. rt: wait-free
    [[nodiscard]] std::uint64_t deadline_ns(std::uint64_t now_ns) const noexcept {
        const bool is_marked = (broken_ & (TACTILED_STALE | TACTILED_DISCONNECTED)) != 0;
        const std::uint64_t latest_ns = now_ns + tuning_->stale_ns;
        return is_marked ? latest_ns : std::min(latest_ns, last_frame_ns_ + tuning_->stale_ns + 1);
    }
    // Returns the reason why there is no stream now; 0 = the stream delivers.
    [[nodiscard]] std::uint32_t broken() const noexcept { return broken_; }
    // Returns the number of discontinuities, including those of frozen channels: the lower half of a sample's epoch.
    [[nodiscard]] std::uint32_t discontinuities() const noexcept { return discontinuities_; }

    [[nodiscard]] std::uint64_t last_frame_ns() const noexcept { return last_frame_ns_; }
    // Returns the number of frames known to be lost since the start.
    [[nodiscard]] std::uint32_t lost() const noexcept { return lost_; }
    // Returns the rate over about the last second; NaN if unknown.
    [[nodiscard]] float rate_Hz() const noexcept { return rate_Hz_; }

private:
    void measure_rate(std::uint64_t t_ns) noexcept;
    [[nodiscard]] std::uint32_t find_frozen(std::span<const double> raw, std::uint32_t usable) noexcept;
    [[nodiscard]] bool is_idle_bus(std::span<const double> raw, std::uint32_t usable) noexcept;

    const Tuning* tuning_;
    std::uint64_t last_frame_ns_ = 0;
    std::uint64_t resumed_ns_ = 0;     // end of the last suspension of the machine
    bool after_discontinuity_ = true;  // this is the first frame of a stream
    std::uint32_t opening_ = 0;        // number of the link's opening for the previous frame
    std::uint32_t broken_ = TACTILED_NO_DATA_YET, discontinuities_ = 0, lost_ = 0;

    std::array<double, kMaxChannels> raw_{};              // numbers of the previous frame
    std::uint32_t known_ = 0;                             // bit k: raw_[k] is a number
    std::array<std::uint64_t, kMaxChannels> moved_ns_{};  // time of the last change of a channel
    std::array<unsigned, kMaxChannels> equal_{},
        moved_{};               // consecutive readings: equal to the previous one; of frozen channels that changed
    std::uint32_t frozen_ = 0;  // bit k: channel k is frozen
    bool has_frozen_ = false;   // a usable channel was frozen in the previous frame
    QuietCheck quiet_;
    unsigned idle_ = 0;  // consecutive numbers of an idle bus

    std::uint64_t rate_since_ns_ = 0;
    std::uint32_t rate_frames_ = 0;
    float rate_Hz_ = std::numeric_limits<float>::quiet_NaN();
};

}  // namespace tactiled
