// Checks the temperature of a sensor. A thermometer that fails, is frozen or jumps has no value; the sensor is then treated
// as a sensor without a thermometer. An exchange of the thermometer is a jump.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "node/tuning.hpp"

namespace tactiled {

class Thermometer {
public:
    // `tuning` must outlive this object.
    explicit Thermometer(const Tuning& tuning) : tuning_(&tuning) {}

    // Faster than a board warms up. If the temperature changes faster, the thermometer does not show the temperature of the
    // channels.
    static constexpr double kSlew_K_per_s = 0.1;

    // Returns the temperature, NaN if there is none or it is doubtful. After a jump the temperature is doubtful until it
    // returns to its value before the jump; a change by the slew is accepted only for the time without readings.
    // rt: wait-free
    [[nodiscard]] double judge(double t_C, std::uint64_t t_ns) noexcept {
        if (!std::isfinite(t_C)) return kNone;
        if (is_frozen(t_C)) return kNone;
        const double since_s = last_ns_ != 0 && t_ns > last_ns_ ? double(t_ns - last_ns_) * 1e-9 : 0;
        last_ns_ = t_ns;
        if (std::isnan(reference_C_)) reference_C_ = t_C;
        // The time in doubt does not count; otherwise any jump would be accepted after some time.
        if (since_s > kGap_s || !is_doubtful_) unjudged_s_ += since_s;
        const double walked_K = kSlew_K_per_s * unjudged_s_;
        is_doubtful_ = std::abs(t_C - reference_C_) > tuning_->thermometer_jump_K + walked_K;
        if (is_doubtful_) return kNone;
        reference_C_ += std::clamp(t_C - reference_C_, -walked_K, walked_K);
        unjudged_s_ = 0;
        return t_C;
    }

    // A tare accepts the present temperature as true, like the present load as zero. A failed tare leaves the doubt
    // unchanged. rt: wait-free
    void begin_tare() noexcept {
        before_tare_C_ = reference_C_;
        reference_C_ = kNone;
    }
    void fail_tare() noexcept { reference_C_ = std::isnan(before_tare_C_) ? reference_C_ : before_tare_C_; }

    // Continues where `before` ended. rt: wait-free
    void succeed(const Thermometer& before) noexcept {
        const Tuning* const tuning = tuning_;
        *this = before;
        tuning_ = tuning;
    }

private:
    static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    static constexpr double kGap_s = 1;
    static constexpr unsigned kAliveAfter = 2;  // changes, as for a channel (quality.cpp)

    [[nodiscard]] bool is_frozen(double t_C) noexcept {
        const bool repeats = t_C == last_C_;
        last_C_ = t_C;
        equal_ = repeats ? std::min(equal_ + 1, std::max(1u, tuning_->thermometer_frozen_after)) : 1;
        moved_ = repeats ? moved_ : std::min(moved_ + 1, kAliveAfter);
        if (tuning_->thermometer_frozen_after != 0 && equal_ >= tuning_->thermometer_frozen_after) {
            frozen_ = true;
            moved_ = 0;
        } else if (tuning_->thermometer_frozen_after == 0 || moved_ >= kAliveAfter) {
            frozen_ = false;
        }
        return frozen_;
    }

    const Tuning* tuning_;
    double reference_C_ = kNone;  // follows the temperature, at most by the slew
    double before_tare_C_ = kNone, last_C_ = kNone;
    std::uint64_t last_ns_ = 0;
    double unjudged_s_ = 0;  // since the last accepted temperature, without the time in doubt
    bool is_doubtful_ = false, frozen_ = false;
    unsigned equal_ = 0, moved_ = 0;
};

}  // namespace tactiled
