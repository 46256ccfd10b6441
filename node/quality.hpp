// Checks that the stream of one sensor is alive and plausible, from times and raw numbers alone. What a number means is the
// model's, what to publish is Sensor's.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>

#include "drivers/frame.hpp"
#include "tactiled/layout.h"

namespace tactiled {

struct StreamLimits {
    std::uint64_t stale_ns = 100'000'000;  // without a frame for longer, there is no value
    unsigned frozen_after = 0;  // equal readings of a channel in a row that it cannot give while it works; 0 = may
    // The same for each channel, where frozen_after is 0: so many readings, and for so long. 0 readings = it may.
    struct Frozen {
        unsigned after = 0;
        std::uint64_t ns = 0;
    };
    std::array<Frozen, kMaxChannels> frozen_of{};
    bool noisy = false;  // noise moves its numbers in every reading: one number everywhere is an idle bus
    double slew_per_s = std::numeric_limits<double>::infinity();  // most that a channel can change, raw numbers a second
    double rate_Hz = 0;                                           // as declared; 0 = not
    double rate_tolerance = 0.2;                                  // of rate_Hz
};

class StreamQuality {
public:
    explicit StreamQuality(const StreamLimits& limits) { judge_by(limits); }

    // Call once, before the first frame. setup
    void start(std::uint64_t now_ns) noexcept { last_frame_ns_ = now_ns; }

    // Goes on counting where `before` ends, after a discontinuity of its own. With the same channels what is dead stays
    // dead.
    // rt: bounded by the channels
    void succeed(const StreamQuality& before, bool same_channels) noexcept;
    // Judges by these from now on; what is known of the stream stays. rt: wait-free
    void judge_by(const StreamLimits& limits) noexcept {
        limits_ = limits;
        judges_repeats_ =
            limits.frozen_after != 0 || std::any_of(limits.frozen_of.begin(), limits.frozen_of.end(),
                                                    [](const StreamLimits::Frozen& one) { return one.after != 0; });
    }

    // A frame came that is older than the stream may be: there is no value until one comes that is not. rt: wait-free
    void arrive_late(const Frame& frame) noexcept;
    // The machine was suspended: what was taken from the kernel until `now_ns` is of before. rt: wait-free
    void suspended(std::uint64_t now_ns) noexcept {
        resumed_ns_ = now_ns;
        last_frame_ns_ = 0;
    }
    [[nodiscard]] bool is_late(const Frame& frame) const noexcept {
        return frame.late_ns > limits_.stale_ns || frame.t_ns < resumed_ns_;
    }
    // The stream delivers; true: again, after a discontinuity. rt: wait-free
    bool arrive(const Frame& frame) noexcept;
    // Looks at the channels of the frame that has just arrived. `usable`: bit k, channel k has a number that is not
    // saturated. What is of no use is set in `dead`: such a channel has no value. Returns reasons. rt: bounded by the
    // channels
    [[nodiscard]] std::uint32_t judge(std::span<const double> raw, std::uint32_t usable, std::uint32_t& dead) noexcept;

    // True when the stream has just broken, or the reason has changed. `connected` is the link's state. rt: wait-free
    [[nodiscard]] bool has_discontinuity(bool connected, std::uint64_t now_ns) noexcept;
    // The time by which it must be asked again, if nothing else happens: the stream's limit, or before the limit of a frame
    // that arrives after `now_ns`. rt: wait-free
    [[nodiscard]] std::uint64_t deadline_ns(std::uint64_t now_ns) const noexcept {
        const bool is_marked = (broken_ & (TACTILED_STALE | TACTILED_DISCONNECTED)) != 0;
        const std::uint64_t latest_ns = now_ns + limits_.stale_ns;
        return is_marked ? latest_ns : std::min(latest_ns, last_frame_ns_ + limits_.stale_ns + 1);
    }
    // Why there is no stream now, 0 = it delivers.
    [[nodiscard]] std::uint32_t broken() const noexcept { return broken_; }
    // Discontinuities so far, those of frozen channels included: the lower half of a sample's epoch.
    [[nodiscard]] std::uint32_t discontinuities() const noexcept { return discontinuities_; }

    [[nodiscard]] std::uint64_t last_frame_ns() const noexcept { return last_frame_ns_; }
    // Frames known to be lost since the start.
    [[nodiscard]] std::uint32_t lost() const noexcept { return lost_; }
    // Measured over the last second or so; NaN where it is not known.
    [[nodiscard]] float rate_Hz() const noexcept { return rate_Hz_; }

private:
    void measure_rate(std::uint64_t t_ns) noexcept;
    [[nodiscard]] StreamLimits::Frozen frozen_limit(std::size_t k) const noexcept {
        return limits_.frozen_after != 0 ? StreamLimits::Frozen{limits_.frozen_after, 0} : limits_.frozen_of[k];
    }
    [[nodiscard]] std::uint32_t find_frozen(std::span<const double> raw, std::uint32_t usable) noexcept;
    [[nodiscard]] bool is_idle_bus(std::span<const double> raw, std::uint32_t usable) noexcept;
    [[nodiscard]] bool has_stepped(std::span<const double> raw, std::uint32_t usable) const noexcept;

    StreamLimits limits_;
    bool judges_repeats_ = false;                    // for some channel
    std::uint64_t last_frame_ns_ = 0, step_ns_ = 0;  // step_ns_: from the frame before
    std::uint64_t resumed_ns_ = 0;                   // the machine was suspended until then
    bool after_discontinuity_ = true;                // this is the first frame of a stream
    std::uint32_t opening_ = 0;                      // of the link, that the frame before came through
    std::uint32_t broken_ = TACTILED_NO_DATA_YET, discontinuities_ = 0, lost_ = 0, lost_now_ = 0;

    std::array<double, kMaxChannels> raw_{};              // of the frame before
    std::uint32_t known_ = 0, newest_ = 0;                // bit k: raw_[k] is a number; of the frame right before
    std::array<std::uint64_t, kMaxChannels> moved_ns_{};  // when a channel last changed
    std::array<unsigned, kMaxChannels> equal_{},
        moved_{};               // readings in a row: like the one before; that frozen ones changed
    std::uint32_t frozen_ = 0;  // bit k
    bool has_frozen_ = false;   // one that was usable, in the frame before
    unsigned idle_ = 0;         // numbers in a row that an idle bus reads

    std::uint64_t rate_since_ns_ = 0;
    std::uint32_t rate_frames_ = 0;
    float rate_Hz_ = std::numeric_limits<float>::quiet_NaN();
};

// Checks if the zero at rest has wandered from the calibration's: a mean of the raw force over about a second without
// contact. Once told it stays told until a mean at rest is within the limit.
class ZeroDrift {
public:
    explicit ZeroDrift(double limit_N) : limit_N_(limit_N) {}
    // rt: wait-free
    void judge_by(double limit_N) noexcept { limit_N_ = limit_N; }
    // rt: wait-free
    [[nodiscard]] bool has_drifted(const double (&raw_force_S_N)[3], bool at_rest, std::uint64_t t_ns) noexcept;

private:
    double limit_N_;  // 0 = not judged
    std::array<double, 3> mean_N_{};
    std::uint64_t since_ns_ = 0, last_ns_ = 0;  // at rest; 0 = not
    bool drifted_ = false;
};

}  // namespace tactiled
