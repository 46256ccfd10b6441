#include "decoupling/grasp/slip.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tactiled::grasp {
namespace {

constexpr std::uint64_t kLook_ns = 7'000'000;  // the fall to kinetic friction takes 5 ms; vibration below 60 Hz is slower
// least distance of points: the fall between two of them is at least as large
constexpr std::uint64_t kStep_ns = 900'000;
constexpr std::uint64_t kGoesOn_ns = 60'000'000;  // the slip has ended after this time without another fall
constexpr std::uint64_t kFirm_ns = 20'000'000;    // a new contact rolls and settles
constexpr double kOverUsual = 1.6;                // times the largest recent fall of a transport
constexpr double kUsualTime_s = 10;
// Parts of the configured or learnt friction. Below kNearCone there is no slip, even if the friction is wrong by 30
// %; a small fall counts only from kAtCone on.
constexpr double kNearCone = 0.7, kAtCone = 0.9, kSmallFall = 0.08;
// A vibration has equal rises and falls. From rest its first fall is at most twice its rise; below 25 Hz a rise takes longer
// than this time, so that a large enough fall within 7 ms has begun before.
constexpr std::uint64_t kRise_ns = 10'000'000;
constexpr double kSwing = 2.2, kFellBefore = 0.15;
constexpr double kMinRatio = 0.1;  // a held object does not slide below this ratio, and a ratio of noise is smaller
constexpr double kNoises = 4;
constexpr double kMeanTime_s = 0.02;  // a peak of vibration is shorter, a pull longer

}  // namespace

void Slip::sensitivity(double zero_to_one) noexcept {
    if (!(zero_to_one >= 0 && zero_to_one <= 1)) return;
    near_ = 0.95 - 0.3 * zero_to_one;
    min_fall_ = 0.08 * std::pow(0.25, zero_to_one);
}

void Slip::forget() noexcept {
    n_ = 0;
    state_ = TACTILED_SLIP_UNKNOWN;
    use_ = kNaN;
    touched_ns_ = 0;
}

Slip::Fall Slip::fall(double noise_N) const noexcept {
    const Point& now = past_[newest_];
    const double ratio = now.shear_N / now.press_N;
    Fall max;
    for (std::size_t back = 0; back < n_; ++back) {
        const Point& p = past_[(newest_ + kMax - back) % kMax];
        if (now.t_ns - p.t_ns > kLook_ns) break;
        // The shear itself must fall: a press that rises, as in a grip that is tightened, is no slip.
        const double before = p.shear_N / p.press_N, sure_N = p.shear_N - now.shear_N - kNoises * noise_N;
        if (sure_N <= 0 || before <= max.peak) continue;
        max = {std::min((before - ratio) / before, sure_N / p.shear_N), before, back};
    }
    return max;
}

bool Slip::swings(const Fall& fall) const noexcept {
    const auto point = [&](std::size_t back) -> const Point& { return past_[(newest_ + kMax - back) % kMax]; };
    double min = fall.peak, max = fall.peak;
    for (std::size_t back = fall.back + 1; back < n_ && point(fall.back).t_ns - point(back).t_ns <= kRise_ns; ++back) {
        const double ratio = point(back).shear_N / point(back).press_N;
        min = std::min(min, ratio);
        max = std::max(max, ratio);
    }
    return fall.part * fall.peak < kSwing * (fall.peak - min) || max - fall.peak > kFellBefore * fall.part * fall.peak;
}

void Slip::take(const Observation& observation, bool touching, bool settled, double noise_N) noexcept {
    if (!std::isfinite(observation.shear_N)) return forget();
    if (!touching || observation.press_N <= kNoises * noise_N || observation.press_N <= 0) {
        forget();
        state_ = TACTILED_SLIP_NONE;
        return;
    }
    if (touched_ns_ == 0) {
        mean_N_ = observation.shear_N;
        touched_ns_ = observation.t_ns;
        usual_ = falling_ = 0;
    }
    use_ = friction_.use(observation.shear_N, observation.press_N);
    if (n_ > 0 && observation.t_ns - past_[newest_].t_ns < kStep_ns) return;
    const double elapsed_s = n_ > 0 ? double(observation.t_ns - past_[newest_].t_ns) * 1e-9 : 0;
    newest_ = (newest_ + 1) % kMax;
    past_[newest_] = {observation.t_ns, observation.shear_N, observation.press_N};
    n_ = std::min(n_ + 1, kMax);

    const Fall now = fall(noise_N);
    const double cone = friction_.coefficient() * (now.part < kSmallFall ? kAtCone : kNearCone);
    const bool slides = state_ == TACTILED_SLIP_GROSS;
    const bool at_cone = now.peak >= kAtCone * friction_.coefficient();  // false if not known
    const bool possible = observation.t_ns - touched_ns_ > kFirm_ns && now.peak >= kMinRatio &&
                          (std::isnan(cone) ? now.part >= kSmallFall : now.peak >= cone);
    const double min = slides ? min_fall_ / 2 : std::max(min_fall_, kOverUsual * usual_);
    if (possible && now.part > min && (slides || at_cone || !swings(now))) {
        if (!slides) {
            ++slips_;
            friction_.slipped(now.peak);
        }
        falling_ = 0;
        slid_ns_ = observation.t_ns;
        state_ = TACTILED_SLIP_GROSS;
        return;
    }
    if (slides && observation.t_ns - slid_ns_ < kGoesOn_ns) return;
    // Unlike a slip, a growing vibration grows over several falls. A fall counts when it has ended, so that the first
    // milliseconds of a slip do not count as transport.
    falling_ = std::max(falling_, now.part);
    const double over = now.part < falling_ / 2 ? std::exchange(falling_, now.part) : 0;
    if (settled) usual_ = std::max(over, usual_ * std::exp(-elapsed_s / kUsualTime_s));
    if (!slides) friction_.held((observation.shear_N - kNoises * noise_N) / observation.press_N);
    // |shear| > part of the limit + k sd; at a small press, the ratio alone would be noise.
    mean_N_ += -std::expm1(-elapsed_s / kMeanTime_s) * (observation.shear_N - mean_N_);
    const double limit_N = near_ * friction_.coefficient() * observation.press_N + kNoises * noise_N;
    state_ = std::min(mean_N_, observation.shear_N) > limit_N ? TACTILED_SLIP_INCIPIENT
                                                              : TACTILED_SLIP_NONE;  // false if not known
}

}  // namespace tactiled::grasp
