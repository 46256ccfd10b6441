#include "decoupling/checked.hpp"

#include <algorithm>
#include <cmath>

#include "decoupling/pairs.hpp"

namespace tactiled {
namespace {

// Two numbers of this size less each other are finite.
constexpr double kPlain = 1e300;
// A square in this range is neither lost nor overflown: its root is as good as hypot(), which takes several times as long.
constexpr double kLeastSquare = 1e-200, kMostSquare = 1e200;

double length(double a, double b) noexcept {
    const double square = a * a + b * b;
    return square > kLeastSquare && square < kMostSquare ? std::sqrt(square) : std::hypot(a, b);
}

}  // namespace

CheckedModel::CheckedModel(const Calibration& calibration, std::uint32_t used, std::uint32_t needed)
    : n_(calibration.channels.size()),
      used_(used),
      needed_(needed & used),
      all_(n_ >= 32 ? ~0u : (1u << n_) - 1),
      sd_known_(!calibration.sd.empty()),
      uncalibrated_(calibration.nominal ? std::uint32_t(TACTILED_UNCALIBRATED) : 0u),
      domain_(calibration) {
    for (std::size_t k = 0; k < n_; ++k) {
        zero_[k] = calibration.zero[k];
        // A zero beyond 1e300 leaves nothing plain.
        plain_channel_least_[k] = std::abs(zero_[k]) <= kPlain ? std::max(domain_.least(k), -kPlain) : kPlain;
        plain_channel_most_[k] = std::abs(zero_[k]) <= kPlain ? std::min(domain_.most(k), kPlain) : -kPlain;
    }
    std::fill_n(sd_, 6, 1.0);  // of what is not seen: any
    std::fill_n(full_scale_, 6, std::numeric_limits<double>::infinity());
    std::fill_n(unseen_nan_, 6, kNaN);
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        seen_[c] = true;
        seen_mask_[c] = -1;
        unseen_nan_[c] = 0;
        if (sd_known_) sd_[c] = calibration.sd[i];
        if (!calibration.sd_slope.empty()) sd_slope_[c] = calibration.sd_slope[i];
        if (!calibration.full_scale.empty()) full_scale_[c] = (1 + kDomainMargin) * calibration.full_scale[i];
    }
    for (std::size_t c = 0; c < 6; ++c) plain_most_[c] = std::min(full_scale_[c], std::numeric_limits<double>::max());
}

// The good reading, which nearly all are, takes a straight way: one comparison for all channels, one for all components.
Estimate CheckedModel::decouple(const Reading& reading) noexcept {
    Estimate estimate;
    if (reading.channel.size() != n_) {
        forget();
        estimate.reasons = TACTILED_WRONG_DEVICE;
        return estimate;
    }
    alignas(32) double r[kMostChannels];
    Input input{.r = {r, n_}, .usable = used_, .outside = false, .t_ns = reading.t_ns};
    const bool plain =
        subtract_zeros(reading.channel.data(), r) && used_ == all_ && ((reading.missing | reading.saturated) & all_) == 0;
    if (!plain && !look_at_each(reading, r, input, estimate)) {
        forget();
        return estimate;
    }
    solve(input, estimate);
    finish(input, estimate);
    if (estimate.quality == TACTILED_BAD) forget();
    return estimate;
}

// False where a channel is not plain. `r` is set in any case, with 0 up to 8.
bool CheckedModel::subtract_zeros(const double* channel, double* r) const noexcept {
    const std::size_t n = n_;
    PairMask plain = {0, 0};  // less 1 for each comparison that holds; for a NaN none does
    std::size_t k = 0;
    for (; k + 2 <= n; k += 2) {
        const Pair value = load(channel + k);
        store(r + k, value - load(zero_ + k));
        plain += value >= load(plain_channel_least_ + k);
        plain += value <= load(plain_channel_most_ + k);
    }
    std::int64_t held = -plain[0] - plain[1];
    if (k < n) {
        r[k] = channel[k] - zero_[k];
        held += channel[k] >= plain_channel_least_[k] ? 1 : 0;
        held += channel[k] <= plain_channel_most_[k] ? 1 : 0;
        ++k;
    }
    for (; k < 8; ++k) r[k] = 0;
    return held == std::int64_t(2 * n);
}

// What is there, what is at its rail, what is beyond the domain. False: BAD.
bool CheckedModel::look_at_each(const Reading& reading, double* r, Input& input, Estimate& estimate) const noexcept {
    const double* const channel = reading.channel.data();
    std::uint32_t broken = 0, beyond = 0;  // without a branch: each channel by itself
    for (std::size_t k = 0; k < n_; ++k) {
        broken |= std::uint32_t(!(std::abs(r[k]) <= std::numeric_limits<double>::max())) << k;
        beyond |= std::uint32_t(domain_.is_beyond(k, channel[k])) << k;
    }
    const std::uint32_t missing = (reading.missing | broken) & used_;
    if (missing != 0) estimate.reasons |= TACTILED_MISSING_CHANNEL;
    if ((missing & needed_) != 0) return false;
    const std::uint32_t saturated = reading.saturated & used_ & ~missing;
    // Beyond the rail a needed channel may be anything, so no standard deviation would be true.
    if (saturated != 0) estimate.reasons |= TACTILED_SATURATED;
    if ((saturated & needed_) != 0) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
    input.usable = used_ & ~missing & ~(saturated & ~needed_);
    if (input.usable != all_)
        for (std::size_t k = 0; k < n_; ++k)
            if ((input.usable >> k & 1u) == 0) r[k] = 0;  // else 0 * NaN of a channel that nobody needs
    input.outside = (beyond & input.usable) != 0;
    return true;
}

// Quality, reasons and deviations of what solve() found; BAD where that is not finite.
void CheckedModel::finish(const Input& input, Estimate& estimate) const noexcept {
    double* const wrench = estimate.wrench_S.data();
    Pair seen[3];
    PairMask plain = {0, 0};  // as in subtract_zeros()
    for (std::size_t c = 0; c < 6; c += 2) {
        const Pair most = load(plain_most_ + c);
        const Pair value = only(load(wrench + c), load(seen_mask_ + c));  // else 0
        plain += value <= most;
        plain += value >= -most;
        seen[c / 2] = value;
        store(wrench + c, with(value, load(unseen_nan_ + c)));
    }
    if (plain[0] + plain[1] != -12) {
        if (!is_finite(estimate.wrench_S)) {
            const std::uint32_t reasons = estimate.reasons;
            estimate = Estimate{};
            estimate.reasons = reasons == 0 ? std::uint32_t(TACTILED_NOT_FINITE) : reasons;
            return;
        }
        estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
    }
    if (input.outside) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
    estimate.reasons |= uncalibrated_;
    if (!sd_known_) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
    if ((estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY) == 0) {
        plain = PairMask{0, 0};
        for (std::size_t c = 0; c < 6; c += 2) {
            const Pair sd = load(sd_ + c), sloped = load(sd_slope_ + c) * seen[c / 2], square = sd * sd + sloped * sloped;
            plain += square > both(kLeastSquare);
            plain += square < both(kMostSquare);
            store(estimate.sd.data() + c, with(load(input.sd_factor.data() + c) * root(square), load(unseen_nan_ + c)));
        }
        if (plain[0] + plain[1] != -12)
            for (std::size_t c = 0; c < 6; ++c)
                if (seen_[c]) estimate.sd[c] = input.sd_factor[c] * length(sd_[c], sd_slope_[c] * wrench[c]);
    }
    estimate.quality = estimate.reasons == 0 ? TACTILED_GOOD : TACTILED_UNCERTAIN;
}

bool CheckedModel::is_finite(const Wrench& wrench) const noexcept {
    for (std::size_t c = 0; c < 6; ++c)
        if (seen_[c] && !std::isfinite(wrench[c])) return false;
    return true;
}

std::string fault_of_checked(const Calibration& calibration) {
    const std::size_t n = calibration.channels.size();
    if (n == 0 || n > kMostChannels) return fmt::format("{} channels; a sensor has 1 .. {}", n, kMostChannels);
    if (calibration.components.empty()) return "components is empty; name at least one of fx fy fz mx my mz";
    if (calibration.zero.size() != n) return fmt::format("zero has {} numbers for {} channels", calibration.zero.size(), n);
    return fault_of_shared_parts(calibration);
}

}  // namespace tactiled
