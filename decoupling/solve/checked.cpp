#include "decoupling/solve/checked.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tactiled {
namespace {

constexpr double kMaxFinite = std::numeric_limits<double>::max();
// The square of a number in this range neither underflows nor overflows.
constexpr double kMinSquared = 1e-99, kMaxSquared = 1e99;

// Bit k of a mask of channels, as wide as a double: a comparison of two doubles selects it without a branch.
struct Bits {
    std::uint64_t of[kMaxChannels];
};
constexpr Bits kBits = [] {
    Bits bits{};
    for (std::size_t k = 0; k < kMaxChannels; ++k) bits.of[k] = std::uint64_t{1} << k;
    return bits;
}();

}  // namespace

CheckedModel::CheckedModel(const Calibration& calibration, std::uint32_t used, std::uint32_t needed)
    : n_(calibration.channels.size()),
      all_(n_ >= 32 ? ~0u : (1u << n_) - 1),
      used_(used & all_),
      needed_(needed & used_),
      always_((calibration.nominal ? std::uint32_t(TACTILED_UNCALIBRATED) : 0u) |
              (calibration.sd.empty() ? std::uint32_t(TACTILED_UNKNOWN_UNCERTAINTY) : 0u)),
      reference_gain_(calibration.reference_gain_sd),
      has_reference_(!calibration.reference_sd.empty() || reference_gain_ > 0),
      load_(calibration),
      correlations_(correlations_of(calibration)),
      domain_(calibration) {
    std::copy_n(calibration.zero.begin(), n_, zero_);
    std::fill_n(full_scale_, 6, std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        seen_[c] = true;
        sd_[c] = calibration.sd.empty() ? 1 : calibration.sd[i];
        if (!calibration.sd_slope.empty()) sd_slope_[c] = calibration.sd_slope[i];
        if (!calibration.sd_load.empty()) sd_load_[c] = calibration.sd_load[i];
        if (!calibration.sd_noise.empty()) noise_[c] = calibration.sd_noise[i];
        if (!calibration.reference_sd.empty()) reference_[c] = calibration.reference_sd[i];
        depends_on_load_ = depends_on_load_ || sd_load_[c] > 0;
        if (!calibration.full_scale.empty()) full_scale_[c] = (1 + kDomainMargin) * calibration.full_scale[i];
        const bool can_be_squared = std::abs(sd_[c]) >= kMinSquared && std::abs(sd_[c]) <= kMaxSquared;
        max_squared_[c] = can_be_squared ? std::min({kMaxFinite, full_scale_[c], kMaxSquared / std::abs(sd_slope_[c])}) : -1;
    }
    std::iota(order_, order_ + 6, std::size_t{0});
    const auto is_seen = [this](std::size_t c) { return seen_[c]; };
    n_seen_ = std::size_t(std::stable_partition(order_, order_ + 6, is_seen) - order_);
}

Estimate CheckedModel::decouple(const Reading& reading) noexcept {
    Estimate estimate;
    if (reading.channel.size() != n_) {
        forget();
        estimate.reasons = TACTILED_WRONG_DEVICE;
        return estimate;
    }
    double r[kMaxChannels];
    std::fill_n(r, 8, 0.0);
    Input input{.r = {r, n_}, .usable = used_, .outside = false, .t_ns = reading.t_ns};
    if (check_channels(reading, r, input, estimate)) {
        solve(input, estimate);
        check_components(input, estimate);
    }
    if (!estimate.has_value) forget();
    return estimate;
}

inline bool CheckedModel::check_channels(const Reading& reading, double* r, Input& input,
                                         Estimate& estimate) const noexcept {
    const double* const channel = reading.channel.data();
    // Both loops vectorise at any number of channels, two channels per step, with -O3, plain arrays, and -fno-trapping-math,
    // which allows comparisons whose result is not needed. r is stored in pairs, as GaugeSolver loads it: a load of two
    // numbers from two single stores waits for both.
    for (std::size_t k = 0; k < n_; ++k) r[k] = channel[k] - zero_[k];
    std::uint64_t broken = 0, beyond = 0;
    for (std::size_t k = 0; k < n_; ++k) {
        broken |= std::abs(r[k]) <= kMaxFinite ? 0 : kBits.of[k];
        beyond |= domain_.is_below(k, channel[k]) ? kBits.of[k] : 0;
        beyond |= domain_.is_above(k, channel[k]) ? kBits.of[k] : 0;
    }
    const std::uint32_t missing = (reading.missing | std::uint32_t(broken)) & used_;
    if (missing != 0) estimate.reasons |= TACTILED_MISSING_CHANNEL;
    if ((missing & needed_) != 0) return false;
    const std::uint32_t saturated = reading.saturated & used_ & ~missing;
    if (saturated != 0) estimate.reasons |= TACTILED_SATURATED;
    // The true value of a saturated channel may be anything beyond the limit, so no standard deviation would be
    // valid.
    if ((saturated & needed_) != 0) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
    input.usable = used_ & ~missing & ~(saturated & ~needed_);
    input.outside = (beyond & input.usable) != 0;
    if (input.usable == all_) return true;
    for (std::size_t k = 0; k < n_; ++k)
        if ((input.usable >> k & 1u) == 0) r[k] = 0;  // prevents 0 * NaN of a channel that is not needed
    return true;
}

inline void CheckedModel::check_components(const Input& input, Estimate& estimate) const noexcept {
    Wrench& wrench = estimate.wrench_S;
    bool finite = true, outside = input.outside, can_be_squared = true;
    for (std::size_t i = n_seen_; i < 6; ++i) wrench[order_[i]] = kNaN;
    for (std::size_t i = 0; i < n_seen_; ++i)
        can_be_squared &= std::abs(wrench[order_[i]]) <= max_squared_[order_[i]];  // false for a NaN
    if (!can_be_squared) [[unlikely]] {
        for (std::size_t i = 0; i < n_seen_; ++i) {
            const double magnitude = std::abs(wrench[order_[i]]);
            finite = finite && magnitude <= kMaxFinite;
            outside = outside || magnitude > full_scale_[order_[i]];
        }
    }
    if (!finite) {
        const std::uint32_t reasons = estimate.reasons;
        estimate = Estimate{};
        estimate.reasons = reasons == 0 ? std::uint32_t(TACTILED_NOT_FINITE) : reasons;
        return;
    }
    estimate.reasons |= always_ | (outside ? std::uint32_t(TACTILED_OUTSIDE_DOMAIN) : 0u);
    estimate.has_value = true;
    estimate.correlations = &correlations_;
    if ((estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY) != 0) {
        estimate.cop_sd_m = {kNaN, kNaN};
        return;
    }
    if (!can_be_squared) [[unlikely]] {
        for (std::size_t i = 0; i < n_seen_; ++i)
            estimate.sd[order_[i]] = input.sd_factor[order_[i]] * stated_sd(order_[i], wrench);
        put_parts(input, estimate);
        return;
    }
    double load_squared = 0;
    if (depends_on_load_)
        for (std::size_t i = 0; i < n_seen_; ++i)
            load_squared += load_.weight(order_[i]) * wrench[order_[i]] * wrench[order_[i]];
    for (std::size_t i = 0; i < n_seen_; ++i) {
        const std::size_t c = order_[i];
        const double sloped = sd_slope_[c] * wrench[c];
        estimate.sd[c] =
            input.sd_factor[c] * std::sqrt(sd_[c] * sd_[c] + sloped * sloped + sd_load_[c] * sd_load_[c] * load_squared);
    }
    put_parts(input, estimate);
}

// The error of the reference is no error that held-out rows show: it is added to theirs. Only that of its gain is alike in
// all components, and has their sign; its offset is an error of this calibration.
inline void CheckedModel::put_parts(const Input& /*input*/, Estimate& estimate) const noexcept {
    for (std::size_t i = 0; i < n_seen_; ++i) estimate.noise[order_[i]] = noise_[order_[i]];
    if (!has_reference_) return;
    for (std::size_t i = 0; i < n_seen_; ++i) {
        const std::size_t c = order_[i];
        estimate.reference[c] = reference_gain_ * estimate.wrench_S[c];
        estimate.sd[c] = std::hypot(estimate.sd[c], reference_[c], estimate.reference[c]);
    }
}

double CheckedModel::stated_sd(std::size_t c, const Wrench& wrench) const noexcept {
    const double of_load = depends_on_load_ ? sd_load_[c] * load_.of(wrench) : 0;
    return std::hypot(sd_[c], sd_slope_[c] * wrench[c], of_load);
}

bool CheckedModel::is_outside(std::span<const double> r, std::uint32_t mask) const noexcept {
    bool any = false;
    for (std::size_t k = 0; k < r.size(); ++k) any = any || ((mask >> k & 1u) != 0 && domain_.is_beyond(k, r[k] + zero_[k]));
    return any;
}

std::string fault_of_checked(const Calibration& calibration) {
    const std::size_t n = calibration.channels.size();
    if (n == 0 || n > kMaxChannels) return fmt::format("{} channels; a sensor has 1 .. {}", n, kMaxChannels);
    if (calibration.components.empty()) return "components is empty; name at least one of fx fy fz mx my mz";
    if (calibration.zero.size() != n && calibration.taxel_files.empty())
        return fmt::format("zero has {} numbers for {} channels", calibration.zero.size(), n);
    return fault_of_shared_parts(calibration);
}

}  // namespace tactiled
