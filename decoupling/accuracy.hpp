// The accuracy of a fit as one number, by which `tactilectl calibrate` and method "auto" order the methods.
#pragma once
#include <cmath>
#include <cstddef>
#include <limits>

#include "config/calibration.hpp"

namespace tactiled {

// The standard deviation that the calibration states, in full scales, at half of full scale, mean over the components;
// infinite where it is not known. setup
inline double inaccuracy(const Calibration& calibration) {
    const std::size_t n = calibration.components.size();
    if (calibration.sd.size() != n || calibration.full_scale.size() != n || n == 0)
        return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double slope = calibration.sd_slope.empty() ? 0.0 : calibration.sd_slope[i];
        sum += std::hypot(calibration.sd[i] / calibration.full_scale[i], slope / 2);
    }
    return sum / double(n);
}

}  // namespace tactiled
