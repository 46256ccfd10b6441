// Zero and gain of each channel against temperature, from the rows of a calibration (decoupling/temperature.hpp).
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Corrects each row of `labelled` to the reference temperature and returns the correction, if the rows cover at least 2 K
// and the temperature lowers the error of a quadratic forward model on held-out stretches. Otherwise returns none and adds
// the reason to `warnings`. setup
Temperature take_temperature_off(const Rows& rows, Labelled& labelled, const Calibration& calibration,
                                 std::vector<std::string>& warnings);

}  // namespace tactiled
