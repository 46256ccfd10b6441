// The structure of the errors on held-out rows: what a mean, a difference or a sum of samples may claim.
#pragma once
#include "decoupling/fit/validate.hpp"

namespace tactiled {

// Sets sd_noise, correlation and alike of a calibration that states an sd, from the held-out rows. Each stays empty where
// the rows do not show it: then nothing averages, components are independent, and no error of the calibration cancels.
void set_error_structure(const Validation& validation, Calibration& calibration);

}  // namespace tactiled
