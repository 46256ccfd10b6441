#include "force_truth.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace tactiled::faults {
namespace {

constexpr double kExact_N = 1e-9;
// A movement by less within a tare need not be detected: the means of its quarters may differ by 3 sd of 70 mN, and at twice
// the rate the last frame is a fifth of one.
constexpr int kSeen = 3 * 70 * 5;  // counts
// 15 time constants of a low pass of 25 Hz, after which the past has no influence
constexpr std::uint64_t kMemoryNs = 60 * kMs;
constexpr double kForgotten_N = 0.002, kForgotten = 2e-5;  // relative to its possible value, a saturated 8389 N

}  // namespace

void ForceTruth::tare_begins(std::uint64_t now_ns) noexcept {
    begin_ns_ = now_ns;
    missed_ = false;
    measured_ = true;
    samples_ = 0;
    sum_N_ = {};
}

void ForceTruth::missed(bool another_daemon) noexcept {
    window_.clear();
    if (another_daemon)
        zero_N_ = {}, count_ = 0;
    else
        missed_ = true;
}

std::string ForceTruth::judge(const tactiled_sample& s, bool is_measured) {
    std::array<double, kChannels> force_N;
    std::copy_n(s.raw_force_S_N, kChannels, force_N.begin());
    if (begin_ns_ != 0 && s.t_ns >= begin_ns_ && (s.reasons & TACTILED_STEPPED) == 0) {
        for (unsigned k = 0; k < kChannels; ++k) {
            const int level = level_of(sensor_, s.device_sequence, k);
            min_[k] = samples_ == 0 ? level : std::min(min_[k], level);
            max_[k] = samples_ == 0 ? level : std::max(max_[k], level);
            sum_N_[k] += s.raw_force_S_N[k];
        }
        ++samples_;
        measured_ &= is_measured;
    }
    std::string wrong;
    if (s.tare_count != count_) {
        wrong = new_zero(s);
        window_.clear();
    }
    // A doubtful value must not contribute to a GOOD one. A low pass waits while a value is not confirmed.
    const bool waits = (s.state & TACTILED_LOW_PASS) != 0 && (s.reasons & TACTILED_STEPPED) != 0;
    if (s.epoch != std::exchange(epoch_, s.epoch) || (s.quality == TACTILED_GOOD && before_ != TACTILED_GOOD))
        window_.clear();
    if (!waits) before_ = s.quality;
    for (unsigned k = 0; k < kChannels; ++k) force_N[k] -= zero_N_[k];
    if (!waits) window_.push_back({s.t_ns, force_N});
    while (window_.size() > 1 && s.t_ns - window_[1].t_ns > kMemoryNs) window_.pop_front();  // it goes straight to the next
    if (waits && std::abs(s.force_S_N[0] - force_N[0]) <= kExact_N) return wrong;            // it waits for its first one
    if ((s.state & TACTILED_LOW_PASS) != 0) return wrong.empty() ? low_passed(s) : wrong;
    for (unsigned k = 0; k < kChannels && wrong.empty(); ++k)
        if (std::abs(s.force_S_N[k] - force_N[k]) > kExact_N)
            wrong = fmt::format("{} N, raw less tare {} N", s.force_S_N[k], force_N[k]);
    return wrong;
}

// The count has changed with this record: to 0, or by one with a zero that is the mean since the command.
std::string ForceTruth::new_zero(const tactiled_sample& s) {
    const bool next = s.tare_count == count_ + 1;
    count_ = s.tare_count;
    if (count_ == 0) {
        zero_N_ = {};
        return "";
    }
    for (unsigned k = 0; k < kChannels; ++k) zero_N_[k] = s.raw_force_S_N[k] - s.force_S_N[k];
    if (missed_) return "";
    if (std::exchange(begin_ns_, 0) == 0) return "a tare that nobody asked for";
    ++tares;
    if (!next) return fmt::format("tare {} is no next one", count_);
    double squares = 0;
    for (unsigned k = 0; k < kChannels; ++k) {
        const double mean_N = sum_N_[k] / samples_;
        squares += mean_N * mean_N;
        if (std::abs(zero_N_[k] - mean_N) > kExact_N)
            return fmt::format("zero {} N, the mean since the command is {} N", zero_N_[k], mean_N);
        if (measured_ && max_[k] - min_[k] > kSeen)
            return fmt::format("a tare of a force that moved by {} counts", max_[k] - min_[k]);
    }
    return limit_N_ > 0 && squares > limit_N_ * limit_N_ ? "a tare under load" : "";
}

// The low pass does not overshoot: its output is within its recent inputs.
std::string ForceTruth::low_passed(const tactiled_sample& s) {
    for (unsigned k = 0; k < kChannels; ++k) {
        double min = HUGE_VAL, max = -HUGE_VAL;
        for (const Past& past : window_) min = std::min(min, past.force_N[k]), max = std::max(max, past.force_N[k]);
        const double slack_N = kForgotten_N + kForgotten * std::max(std::abs(min), std::abs(max));
        if (s.force_S_N[k] < min - slack_N || s.force_S_N[k] > max + slack_N)
            return fmt::format("low-passed {} N, of {} .. {} N", s.force_S_N[k], min, max);
    }
    return "";
}

}  // namespace tactiled::faults
