#include "decoupling/checked.hpp"

#include <cmath>

namespace tactiled {
namespace {

// hypot() where that matters: it takes several times as long as the root.
double length(double a, double b) noexcept {
    const double square = a * a + b * b;
    return square > 1e-200 && square < 1e200 ? std::sqrt(square) : std::hypot(a, b);
}

}  // namespace

CheckedModel::CheckedModel(const Calibration& calibration, std::uint32_t used, std::uint32_t needed)
    : n_(calibration.channels.size()),
      used_(used),
      needed_(needed & used),
      all_(n_ >= 32 ? ~0u : (1u << n_) - 1),
      sd_known_(!calibration.sd.empty()),
      domain_(calibration) {
    for (std::size_t k = 0; k < n_; ++k) zero_[k] = calibration.zero[k];
    full_scale_.fill(std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        seen_[c] = true;
        if (sd_known_) sd_[c] = calibration.sd[i];
        if (!calibration.sd_slope.empty()) sd_slope_[c] = calibration.sd_slope[i];
        if (!calibration.full_scale.empty()) full_scale_[c] = (1 + kDomainMargin) * calibration.full_scale[i];
    }
}

Estimate CheckedModel::decouple(const Reading& reading) noexcept {
    Estimate estimate;
    const auto bad = [&](std::uint32_t reasons) {
        forget();
        Estimate nothing;
        nothing.reasons = estimate.reasons | reasons;
        return nothing;
    };
    if (reading.channel.size() != n_) return bad(TACTILED_WRONG_DEVICE);
    double r[kMostChannels];
    const double *const channel = reading.channel.data(), *const zero = zero_.data();
    std::uint32_t broken = 0, beyond = 0;  // without a branch: each channel by itself
    for (std::size_t k = 0; k < n_; ++k) {
        const double value = channel[k];
        r[k] = value - zero[k];
        broken |= std::uint32_t(!(std::abs(r[k]) <= std::numeric_limits<double>::max())) << k;
        beyond |= std::uint32_t(domain_.is_beyond(k, value)) << k;
    }
    const std::uint32_t missing = (reading.missing | broken) & used_;
    if (missing != 0) estimate.reasons |= TACTILED_MISSING_CHANNEL;
    if ((missing & needed_) != 0) return bad(0);
    const std::uint32_t saturated = reading.saturated & used_ & ~missing;
    // Beyond the rail a needed channel may be anything, so no standard deviation would be true.
    if (saturated != 0) estimate.reasons |= TACTILED_SATURATED;
    if ((saturated & needed_) != 0) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;

    Input input{.r = {r, n_}, .usable = used_ & ~missing & ~(saturated & ~needed_), .outside = false, .t_ns = reading.t_ns};
    if (input.usable != all_)
        for (std::size_t k = 0; k < n_; ++k)
            if ((input.usable >> k & 1u) == 0) r[k] = 0;  // else 0 * NaN of a channel that nobody needs
    input.outside = (beyond & input.usable) != 0;
    solve(input, estimate);
    if (!is_finite(estimate.wrench_S)) return bad(estimate.reasons == 0 ? std::uint32_t(TACTILED_NOT_FINITE) : 0u);

    for (std::size_t c = 0; c < 6; ++c)
        if (!seen_[c]) estimate.wrench_S[c] = kNaN;
    if (input.outside) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
    for (std::size_t c = 0; c < 6; ++c)
        if (std::abs(estimate.wrench_S[c]) > full_scale_[c]) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
    if (!sd_known_) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
    if ((estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY) == 0)
        for (std::size_t c = 0; c < 6; ++c)
            if (seen_[c]) estimate.sd[c] = input.sd_factor[c] * length(sd_[c], sd_slope_[c] * estimate.wrench_S[c]);
    estimate.quality = estimate.reasons == 0 ? TACTILED_GOOD : TACTILED_UNCERTAIN;
    return estimate;
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
