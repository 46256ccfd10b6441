// Tells if a device has gone on between two of its frames, or may have been restarted or exchanged: a device that starts may
// take its present load for zero.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "drivers/frame.hpp"
#include "drivers/wire/sequence_tracker.hpp"

namespace tactiled {

// A device goes on if its counter and its clock do: the counter advances, by no more than the time allows; the clock
// advances with the time. A device without either, or with a counter that is too short for the time, goes on over a gap that
// is shorter than a start if its link stays. Its sensor may be another one if a channel was missing for as long as that.
class Continuity {
public:
    // Takes the device's next frame, `has_all`: with all channels, measured at `t_ns` of a clock that does not stop while
    // the machine is suspended. `rate_Hz`: measured, NaN = unknown. `gap_ns`: longest gap of a device that has not started
    // again. Returns false if it may have done so since the frame before. rt: wait-free
    [[nodiscard]] bool goes_on(const Frame& frame, bool has_all, std::uint64_t t_ns, double rate_Hz,
                               std::uint64_t gap_ns) noexcept {
        const Known before =
            std::exchange(before_, {t_ns, frame.device_time_us, frame.sequence, frame.opening, frame.has_sequence});
        if (begun_ns_ == 0) begun_ns_ = t_ns;
        if (rate_Hz > 0)
            rate_Hz_ = rate_Hz;
        else if (frames_ < kFirst && (frames_ += 1) == kFirst)  // until it is measured
            rate_Hz_ = kFirst * 1e9 / double(t_ns - begun_ns_);
        const unsigned bits = std::min(width_.of(frame.sequence), unsigned{frame.sequence_bits});
        const bool was_missing = has_all && missing_ns_ != 0 && t_ns > missing_ns_ + gap_ns;
        if (has_all || missing_ns_ == 0) missing_ns_ = has_all ? 0 : t_ns;
        is_proved_ = false;
        if (before.t_ns == 0) return true;
        if (frame.restarted) return false;
        const double passed_s = double(std::int64_t(t_ns - before.t_ns)) * 1e-9;

        if (frame.has_sequence && before.has_sequence) {
            const std::uint32_t mask = bits >= 32 ? ~0u : (1u << bits) - 1;
            const std::uint32_t ahead = (frame.sequence - before.sequence) & mask;
            const double possible = kFaster * step_ * rate_Hz_ * (passed_s + kBurst_s);
            if (possible < double(mask) / 2 && (ahead == 0 || ahead > possible)) return false;  // not with NaN
            is_proved_ = possible < double(mask) / kChance;
            if (ahead <= mask / 2) step_ = std::isnan(step_) ? ahead : step_ + (ahead - step_) / kSteps;
        }
        if (frame.device_time_us != 0 && before.device_time_us != 0) {
            const auto clock_us = std::uint32_t(frame.device_time_us - before.device_time_us);
            const double late_s = std::int32_t(std::uint32_t(std::int64_t(passed_s * 1e6)) - clock_us) * 1e-6;
            is_proved_ = late_s <= passed_s && std::abs(late_s) <= kHeld_s;
            if (!is_proved_) return false;  // it went back, or is another one
        }
        const bool is_blink = passed_s * 1e9 < double(gap_ns) && frame.opening == before.opening;
        return !was_missing && (is_proved_ || is_blink);
    }
    // Returns true if a counter or clock shows that the device of the last two frames has not started again in between.
    [[nodiscard]] bool has_proof() const noexcept { return is_proved_; }

private:
    static constexpr double kBurst_s = 1;  // frames that waited come faster, for so long
    static constexpr double kHeld_s = 10;  // frames may be held for so long, or what was held may be discarded
    static constexpr double kFaster = 2;   // the rate may change by this factor
    static constexpr double kChance = 16;  // a number of another count proves by chance once in so many times
    static constexpr double kSteps = 16;   // frames of the mean step of a counter
    static constexpr double kFirst = 16;   // frames of the first rate

    struct Known {
        std::uint64_t t_ns = 0, device_time_us = 0;
        std::uint32_t sequence = 0, opening = 0;
        bool has_sequence = false;
    };
    Known before_;
    double frames_ = 0;
    std::uint64_t begun_ns_ = 0;    // time of the first frame
    std::uint64_t missing_ns_ = 0;  // since then a channel is missing; 0: none
    bool is_proved_ = false;
    CounterWidth width_;
    double rate_Hz_ = std::numeric_limits<double>::quiet_NaN();
    double step_ = std::numeric_limits<double>::quiet_NaN();  // mean, of the counter in one frame
};

}  // namespace tactiled
