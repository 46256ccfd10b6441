// The accuracy of a fit as one number, by which `tactilectl calibrate` and method "auto" order the methods.
#pragma once
#include <cmath>
#include <cstddef>
#include <limits>

#include "config/calibration.hpp"

namespace tactiled {

// Error on rows that the fit had not seen, in full scales, mean over the components; of a file without that number the
// standard deviation that it states at half of full scale; infinite where neither is known. setup
inline double inaccuracy(const Calibration& calibration) {
    const std::size_t n = calibration.components.size();
    if (calibration.sd.size() != n || calibration.full_scale.size() != n || n == 0)
        return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double slope = calibration.sd_slope.empty() ? 0.0 : calibration.sd_slope[i];
        sum += calibration.held_out_rms.size() == n ? calibration.held_out_rms[i] / calibration.full_scale[i]
                                                    : std::hypot(calibration.sd[i] / calibration.full_scale[i], slope / 2);
    }
    return sum / double(n);
}

}  // namespace tactiled
