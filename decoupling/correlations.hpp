// The correlations of the errors that a calibration states: between components, and between loads.
#pragma once
#include "config/calibration.hpp"
#include "decoupling/decoupler.hpp"

namespace tactiled {

// Returns the correlations that the calibration states; `model` is the same for each calibration of one model.
// setup
Correlations correlations_of(const Calibration& calibration);

}  // namespace tactiled
