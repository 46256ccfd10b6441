// The common part of all models about a calibration: its range of channels, and checks of the parts that every model
// has.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "decoupling/decoupler.hpp"

namespace tactiled {

// Margin on each side, relative to the calibrated width: a calibration samples its extremes rarely, so a sensor used over
// the same range, or a noisy sensor at rest, would leave the range. A linear map changes by no more than 5 % of its
// validated range there.
inline constexpr double kDomainMargin = 0.05;

// Returns the index of a component in a Wrench, 6 for an unknown name.
inline std::size_t component_index(std::string_view name) noexcept {
    return std::size_t(std::find(kComponentNames.begin(), kComponentNames.end(), name) - kComponentNames.begin());
}

class Domain {
public:
    explicit Domain(const Calibration& calibration) {
        std::fill_n(min_, 32, -std::numeric_limits<double>::infinity());
        std::fill_n(max_, 32, std::numeric_limits<double>::infinity());
        for (std::size_t k = 0; k < calibration.channel_least.size() && k < 32; ++k) {
            const double margin = kDomainMargin * (calibration.channel_most[k] - calibration.channel_least[k]);
            min_[k] = calibration.channel_least[k] - margin;
            max_[k] = calibration.channel_most[k] + margin;
        }
    }

    // False for a NaN. rt: wait-free
    [[nodiscard]] bool is_below(std::size_t k, double value) const noexcept { return value < min_[k]; }
    [[nodiscard]] bool is_above(std::size_t k, double value) const noexcept { return value > max_[k]; }
    [[nodiscard]] bool is_beyond(std::size_t k, double value) const noexcept {
        return is_below(k, value) || is_above(k, value);
    }

    // Returns the value of channel k in the domain (including the margin) that is nearest to `value`. rt: wait-free
    [[nodiscard]] double nearest(std::size_t k, double value) const noexcept { return std::clamp(value, min_[k], max_[k]); }

    [[nodiscard]] double min(std::size_t k) const noexcept { return min_[k]; }
    [[nodiscard]] double max(std::size_t k) const noexcept { return max_[k]; }

private:
    double min_[32], max_[32];  // plain arrays: the loop reads one channel at a time
};

// Returns the fault of components, sd, full scale, domain or a number of the calibration; "" if there is none. setup
inline std::string fault_of_shared_parts(const Calibration& calibration) {
    const std::size_t n = calibration.channels.size(), rows = calibration.components.size();
    for (std::size_t i = 0; i < rows; ++i) {
        if (component_index(calibration.components[i]) == 6)
            return fmt::format("components has \"{}\"; known are fx fy fz mx my mz", calibration.components[i]);
        for (std::size_t j = 0; j < i; ++j)
            if (calibration.components[i] == calibration.components[j])
                return fmt::format("components has \"{}\" twice", calibration.components[i]);
    }
    if (!calibration.sd.empty() && calibration.sd.size() != rows)
        return fmt::format("sd has {} numbers for {} components", calibration.sd.size(), rows);
    if (!calibration.full_scale.empty() && calibration.full_scale.size() != rows)
        return fmt::format("full_scale has {} numbers for {} components", calibration.full_scale.size(), rows);
    if (calibration.channel_least.size() != calibration.channel_most.size() ||
        (!calibration.channel_least.empty() && calibration.channel_least.size() != n))
        return fmt::format("channel_least and channel_most need {} numbers each, or none", n);
    if (!calibration.held_out_rms.empty() && calibration.held_out_rms.size() != rows)
        return fmt::format("held_out_rms has {} numbers for {} components", calibration.held_out_rms.size(), rows);
    if (!calibration.zero_drift.empty() && calibration.zero_drift.size() != n)
        return fmt::format("zero_drift has {} numbers for {} channels", calibration.zero_drift.size(), n);
    const auto all_finite = [](const std::vector<double>& numbers) {
        return std::all_of(numbers.begin(), numbers.end(), [](double number) { return std::isfinite(number); });
    };
    if (!calibration.sd_slope.empty() && calibration.sd_slope.size() != rows)
        return fmt::format("sd_slope has {} numbers for {} components", calibration.sd_slope.size(), rows);
    if (!calibration.sd_load.empty() && calibration.sd_load.size() != rows)
        return fmt::format("sd_load has {} numbers for {} components", calibration.sd_load.size(), rows);
    if (!calibration.sd_noise.empty() && calibration.sd_noise.size() != rows)
        return fmt::format("sd_noise has {} numbers for {} components", calibration.sd_noise.size(), rows);
    if (!calibration.reference_sd.empty() && calibration.reference_sd.size() != rows)
        return fmt::format("reference_sd has {} numbers for {} components", calibration.reference_sd.size(), rows);
    if (!calibration.correlation.empty() && calibration.correlation.size() != rows * (rows - 1) / 2)
        return fmt::format("correlation has {} numbers, and needs {}: one for each pair of components",
                           calibration.correlation.size(), rows * (rows - 1) / 2);
    for (const auto* numbers :
         {&calibration.zero, &calibration.correlation, &calibration.alike, &calibration.sd_noise, &calibration.reference_sd,
          &calibration.channel_least, &calibration.channel_most, &calibration.sd, &calibration.sd_slope,
          &calibration.sd_load, &calibration.full_scale, &calibration.held_out_rms, &calibration.zero_drift})
        if (!all_finite(*numbers)) return "a number is not finite";
    for (const auto& row : calibration.matrix)
        if (!all_finite(row)) return "a number of matrix is not finite";
    for (const auto& [name, table] : calibration.tables)
        for (const auto& row : table)
            if (!all_finite(row)) return fmt::format("a number of table {} is not finite", name);
    for (const auto& [name, number] : calibration.parameters)
        if (!std::isfinite(number)) return fmt::format("parameter {} is not finite", name);
    return "";
}

}  // namespace tactiled
