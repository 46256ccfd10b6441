// Model "capacitive", method "ratio": the pad with the overlap to first order.
#include <cmath>

#include "decoupling/fit/capacitive_fit.hpp"

namespace tactiled {
namespace {

void fit_ratio(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const FittedPad fitted = fit_pad(rows, nullptr, 1, calibration, warnings);
    calibration.parameters["shear_scale_N"] = std::exp(fitted.p[kLogShear]);
}

const FitEntry entry{.model = "capacitive", .method = "ratio", .fit = fit_ratio, .channels = kElectrodeOfPad};

}  // namespace
}  // namespace tactiled
