#include "decoupling/solve/checked.hpp"

#include <algorithm>
#include <cmath>

#include "decoupling/solve/checked_loop.hpp"

namespace tactiled {
namespace {

// Two numbers of this size less each other are finite.
constexpr double kPlain = 1e300;
// The square of a number in this range is neither lost nor overflown: the root of a sum is as good as hypot(), which takes
// several times as long.
constexpr double kMinSquared = 1e-99, kMaxSquared = 1e99;

}  // namespace

CheckedModel::CheckedModel(const Calibration& calibration, std::uint32_t used, std::uint32_t needed)
    : n_(calibration.channels.size()),
      all_(n_ >= 32 ? ~0u : (1u << n_) - 1),
      always_((calibration.nominal ? std::uint32_t(TACTILED_UNCALIBRATED) : 0u) |
              (calibration.sd.empty() ? std::uint32_t(TACTILED_UNKNOWN_UNCERTAINTY) : 0u)),
      domain_(calibration) {
    used_ = used & all_;
    needed_ = needed & used_;
    for (std::size_t k = 0; k < n_; ++k) {
        auto& pair = channels_[k / 2];
        const double zero = calibration.zero[k];
        pair.zero[k % 2] = zero;
        // A zero beyond 1e300 leaves nothing plain, and so does a channel that may be anything.
        const bool can_be_plain = std::abs(zero) <= kPlain && used_ == all_;
        pair.min[k % 2] = can_be_plain ? std::max(domain_.min(k), -kPlain) : kPlain;
        pair.max[k % 2] = can_be_plain ? std::min(domain_.max(k), kPlain) : -kPlain;
    }
    full_scale_.fill(std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        seen_[c] = true;
        sd_[c] = calibration.sd.empty() ? 1 : calibration.sd[i];
        if (!calibration.sd_slope.empty()) sd_slope_[c] = calibration.sd_slope[i];
        if (!calibration.full_scale.empty()) full_scale_[c] = (1 + kDomainMargin) * calibration.full_scale[i];
        const double max =
            std::min({full_scale_[c], std::numeric_limits<double>::max(), kMaxSquared / std::abs(sd_slope_[c])});
        const bool can_be_plain = std::abs(sd_[c]) >= kMinSquared && std::abs(sd_[c]) <= kMaxSquared;
        auto& pair = components_[c / 2];
        pair.seen[c % 2] = -1;
        pair.unseen_nan[c % 2] = 0;
        pair.max[c % 2] = can_be_plain ? max : -1;
        pair.sd_squared[c % 2] = sd_[c] * sd_[c];
        pair.slope[c % 2] = sd_slope_[c];
    }
    has_third_ = seen_[4] || seen_[5];
}

[[gnu::flatten]] Estimate CheckedModel::decouple(const Reading& reading) noexcept {
    return checked(reading, [this](Input& input, Estimate& estimate) { solve(input, estimate); });
}

// What is there, what is at its rail, what is beyond the domain.
CheckedModel::Looked CheckedModel::look_at_each(const Reading& reading, double* r) const noexcept {
    const double* const channel = reading.channel.data();
    Looked looked{.bad = true, .outside = false, .usable = 0, .reasons = 0};
    std::uint32_t broken = 0, beyond = 0;  // without a branch: each channel by itself
    for (std::size_t k = 0; k < n_; ++k) {
        broken |= std::uint32_t(!(std::abs(r[k]) <= std::numeric_limits<double>::max())) << k;
        beyond |= std::uint32_t(domain_.is_beyond(k, channel[k])) << k;
    }
    const std::uint32_t missing = (reading.missing | broken) & used_;
    if (missing != 0) looked.reasons |= TACTILED_MISSING_CHANNEL;
    if ((missing & needed_) != 0) return looked;
    const std::uint32_t saturated = reading.saturated & used_ & ~missing;
    // Beyond the rail a needed channel may be anything, so no standard deviation would be true.
    if (saturated != 0) looked.reasons |= TACTILED_SATURATED;
    if ((saturated & needed_) != 0) looked.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
    looked.usable = used_ & ~missing & ~(saturated & ~needed_);
    if (looked.usable != all_)
        for (std::size_t k = 0; k < n_; ++k)
            if ((looked.usable >> k & 1u) == 0) r[k] = 0;  // else 0 * NaN of a channel that nobody needs
    looked.outside = (beyond & looked.usable) != 0;
    looked.bad = false;
    return looked;
}

bool CheckedModel::is_outside(std::span<const double> r, std::uint32_t mask) const noexcept {
    bool any = false;
    for (std::size_t k = 0; k < r.size(); ++k)
        any = any || ((mask >> k & 1u) != 0 && domain_.is_beyond(k, r[k] + channels_[k / 2].zero[k % 2]));
    return any;
}

// finish() where a component is not finite (BAD), beyond its full scale, or its deviation takes hypot().
void CheckedModel::finish_hard(bool outside, const double* sd_factor, Estimate& estimate) const noexcept {
    bool finite = true;
    for (std::size_t c = 0; c < 6; ++c) {
        if (!seen_[c]) estimate.wrench_S[c] = kNaN;
        finite = finite && (!seen_[c] || std::isfinite(estimate.wrench_S[c]));
        outside = outside || (seen_[c] && std::abs(estimate.wrench_S[c]) > full_scale_[c]);
    }
    if (!finite) {
        const std::uint32_t reasons = estimate.reasons;
        estimate = Estimate{};
        estimate.reasons = reasons == 0 ? std::uint32_t(TACTILED_NOT_FINITE) : reasons;
        return;
    }
    estimate.reasons |= always_ | (outside ? std::uint32_t(TACTILED_OUTSIDE_DOMAIN) : 0u);
    estimate.quality = estimate.reasons == 0 ? TACTILED_GOOD : TACTILED_UNCERTAIN;
    if ((estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY) != 0) return;
    for (std::size_t c = 0; c < 6; ++c)
        if (seen_[c]) estimate.sd[c] = sd_factor[c] * std::hypot(sd_[c], sd_slope_[c] * estimate.wrench_S[c]);
}

std::string fault_of_checked(const Calibration& calibration) {
    const std::size_t n = calibration.channels.size();
    if (n == 0 || n > kMaxChannels) return fmt::format("{} channels; a sensor has 1 .. {}", n, kMaxChannels);
    if (calibration.components.empty()) return "components is empty; name at least one of fx fy fz mx my mz";
    if (calibration.zero.size() != n) return fmt::format("zero has {} numbers for {} channels", calibration.zero.size(), n);
    return fault_of_shared_parts(calibration);
}

}  // namespace tactiled
