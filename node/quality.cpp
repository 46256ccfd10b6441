#include "node/quality.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled {
namespace {

constexpr std::uint64_t kRateWindowNs = 1'000'000'000;
// A frozen channel counts as alive after this many changes, because a single change may still be part of the fault.
constexpr unsigned kAliveAfter = 2;
// An idle bus gives the same number in all channels. A working converter may rest near 0, too: with noise of one count 2 of
// 5 readings are 0, and 24 consecutive zeros occur once in 10^9 readings. At least 3 readings, because a single reading may
// be disturbed.
constexpr unsigned kIdleNumbers = 24, kIdleReadings = 3;

// Returns true for a number whose bits are all 0 or all 1, for the usual widths of converters and registers, signed or
// unsigned.
bool is_idle_number(double value) noexcept {
    constexpr double kOnes[] = {0, -1, 0xFF, 0x3FF, 0xFFF, 0xFFFF, 0xFFFFF, 0xFFFFFF, 0xFFFFFFFF};
    return std::find(std::begin(kOnes), std::end(kOnes), value) != std::end(kOnes);
}

}  // namespace

void StreamQuality::succeed(const StreamQuality& before, bool same_channels) noexcept {
    last_frame_ns_ = before.last_frame_ns_;
    opening_ = before.opening_;
    discontinuities_ = before.discontinuities_ + 1;
    lost_ = before.lost_;
    if (!same_channels) return;
    raw_ = before.raw_;
    known_ = before.known_;
    equal_ = before.equal_;
    moved_ns_ = before.moved_ns_;
    moved_ = before.moved_;
    frozen_ = before.frozen_;
    has_frozen_ = before.has_frozen_;
    idle_ = before.idle_;
}

bool StreamQuality::arrive(const Frame& frame) noexcept {
    // The link was closed and opened again while the loop did not run; this discontinuity has not been counted yet.
    if (broken_ == 0 && frame.opening != opening_) {
        ++discontinuities_;
        broken_ = TACTILED_DISCONNECTED;
    }
    opening_ = frame.opening;
    after_discontinuity_ = broken_ != 0;
    if (after_discontinuity_) rate_frames_ = 0;
    broken_ = 0;
    last_frame_ns_ = frame.t_ns;
    lost_ += frame.lost;
    measure_rate(frame.t_ns);
    return after_discontinuity_;
}

void StreamQuality::arrive_late(const Frame& frame) noexcept {
    opening_ = frame.opening;
    lost_ += frame.lost;
    if ((broken_ & TACTILED_STALE) != 0) return;
    if (broken_ == 0) ++discontinuities_;
    broken_ = (broken_ & TACTILED_NO_DATA_YET) | TACTILED_STALE;
    rate_Hz_ = std::numeric_limits<float>::quiet_NaN();
}

std::uint32_t StreamQuality::judge(std::span<const double> raw, std::uint32_t usable, std::uint32_t& dead) noexcept {
    std::uint32_t reasons = 0;
    // The comparison is false for an unknown rate, which is NaN.
    if (tuning_->rate_Hz > 0 && std::abs(double(rate_Hz_) - tuning_->rate_Hz) > tuning_->rate_tolerance * tuning_->rate_Hz)
        reasons |= TACTILED_WRONG_RATE;
    if ((dead = find_frozen(raw, usable)) != 0) reasons |= TACTILED_FROZEN;
    if (tuning_->noisy && is_idle_bus(raw, usable)) {
        reasons |= TACTILED_IDLE_BUS;
        dead = ~0u;
    }
    if (quiet_.judge(raw, usable, last_frame_ns_, *tuning_)) reasons |= TACTILED_TOO_QUIET;
    for (std::size_t k = 0; k < raw.size(); ++k)
        if ((usable >> k & 1u) != 0) raw_[k] = raw[k];
    known_ |= usable;
    return reasons;
}

std::uint32_t StreamQuality::find_frozen(std::span<const double> raw, std::uint32_t usable) noexcept {
    for (std::size_t k = 0; k < raw.size(); ++k) {
        if ((usable >> k & 1u) == 0) continue;  // a saturated value may repeat
        const Tuning::Frozen limit = tuning_->frozen_of[k];
        if (raw[k] == raw_[k] && (known_ >> k & 1u) != 0) {
            equal_[k] = std::min(equal_[k] + 1, std::max(1u, limit.after));
        } else {
            equal_[k] = 1;
            moved_ns_[k] = last_frame_ns_;
            moved_[k] = std::min(moved_[k] + 1, kAliveAfter);
        }
        if (limit.after != 0 && equal_[k] >= limit.after && last_frame_ns_ - moved_ns_[k] >= limit.ns) {
            frozen_ |= 1u << k;
            moved_[k] = 0;
        } else if (limit.after == 0 || moved_[k] >= kAliveAfter) {
            frozen_ &= ~(1u << k);
        }
    }
    const std::uint32_t dead = frozen_ & usable;
    if (dead != 0 && !has_frozen_) ++discontinuities_;
    has_frozen_ = dead != 0;
    return dead;
}

bool StreamQuality::is_idle_bus(std::span<const double> raw, std::uint32_t usable) noexcept {
    const auto n = unsigned(raw.size());
    const bool idle = n > 0 && usable == (n >= 32 ? ~0u : (1u << n) - 1) && is_idle_number(raw[0]) &&
                      std::all_of(raw.begin(), raw.end(), [&](double value) { return value == raw[0]; });
    const unsigned enough = std::max(kIdleNumbers, kIdleReadings * n);
    const bool before = idle_ >= enough;
    idle_ = idle ? std::min(idle_ + n, enough) : 0;
    if (!before && idle_ >= enough) ++discontinuities_;
    return idle_ >= enough;
}

void StreamQuality::measure_rate(std::uint64_t t_ns) noexcept {
    if (rate_frames_++ == 0) {
        rate_since_ns_ = t_ns;
    } else if (t_ns > rate_since_ns_ && t_ns - rate_since_ns_ >= kRateWindowNs) {
        rate_Hz_ = float(double(rate_frames_ - 1) * 1e9 / double(t_ns - rate_since_ns_));
        rate_since_ns_ = t_ns;
        rate_frames_ = 1;
    }
}

bool StreamQuality::has_discontinuity(bool connected, std::uint64_t now_ns) noexcept {
    if (connected && now_ns <= last_frame_ns_ + tuning_->stale_ns) return false;
    const std::uint32_t waiting = broken_ & TACTILED_NO_DATA_YET;
    const std::uint32_t why = waiting | (connected ? TACTILED_STALE : TACTILED_DISCONNECTED);
    if (why == broken_) return false;
    if (broken_ == 0) ++discontinuities_;  // a new discontinuity, not a new reason for the present one
    broken_ = why;
    rate_Hz_ = std::numeric_limits<float>::quiet_NaN();
    return true;
}

}  // namespace tactiled
