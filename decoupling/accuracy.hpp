// The accuracy of a fit as one number, by which `tactilectl calibrate` and method "auto" order the methods.
#pragma once
#include <cmath>
#include <cstddef>
#include <limits>

#include "config/calibration.hpp"

namespace tactiled {

// Returns the error on rows that the fit did not use, relative to full scale, as a mean over the components; for a
// file without that number, the standard deviation that it states at half of full scale; infinite if neither is
// known. setup
inline double inaccuracy(const Calibration& calibration) {
    const std::size_t n = calibration.components.size();
    if (calibration.sd.size() != n || calibration.full_scale.size() != n || n == 0)
        return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double slope = calibration.sd_slope.empty() ? 0.0 : calibration.sd_slope[i];
        const double load = calibration.sd_load.empty() ? 0.0 : calibration.sd_load[i] / calibration.full_scale[i];
        sum += calibration.held_out_rms.size() == n
                   ? calibration.held_out_rms[i] / calibration.full_scale[i]
                   : std::hypot(calibration.sd[i] / calibration.full_scale[i], slope / 2, load / 2);
    }
    return sum / double(n);
}

}  // namespace tactiled
