// The load on a sensor as one number: the magnitude of the force, or of the moment where no force is measured, relative to
// the largest full scale. The standard deviation of a component may depend on the load.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "decoupling/solve/domain.hpp"

namespace tactiled {

class LoadScale {
public:
    // Without full scales every load is 0. setup
    explicit LoadScale(const Calibration& calibration) {
        const std::size_t n = std::min(calibration.components.size(), calibration.full_scale.size());
        const auto is_force = [&](std::size_t i) { return component_index(calibration.components[i]) < 3; };
        bool any_force = false;
        for (std::size_t i = 0; i < n; ++i) any_force = any_force || is_force(i);
        double greatest = 0;
        for (std::size_t i = 0; i < n; ++i)
            if (is_force(i) == any_force) greatest = std::max(greatest, calibration.full_scale[i]);
        for (std::size_t i = 0; i < n && greatest > 0; ++i)
            if (is_force(i) == any_force) weight_[component_index(calibration.components[i])] = 1 / (greatest * greatest);
    }
    // A component that is not finite does not count. rt: wait-free
    [[nodiscard]] double of(const Wrench& wrench_S) const noexcept {
        double squares = 0;
        for (std::size_t c = 0; c < 6; ++c)
            if (weight_[c] > 0 && std::isfinite(wrench_S[c])) squares += weight_[c] * wrench_S[c] * wrench_S[c];
        return std::sqrt(squares);
    }
    // 1 / greatest full scale squared for a component that counts, else 0. rt: wait-free
    [[nodiscard]] double weight(std::size_t c) const noexcept { return weight_[c]; }

private:
    double weight_[6]{};
};

// Returns the sd that the calibration states for its component i at this wrench, without that of unloading. setup
inline double stated_sd(const Calibration& calibration, std::size_t i, const Wrench& wrench_S) {
    const double slope = i < calibration.sd_slope.size() ? calibration.sd_slope[i] : 0;
    const double load = i < calibration.sd_load.size() ? calibration.sd_load[i] * LoadScale(calibration).of(wrench_S) : 0;
    return std::hypot(calibration.sd[i], slope * wrench_S[component_index(calibration.components[i])], load);
}

}  // namespace tactiled
