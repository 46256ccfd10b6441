// Fits of model "capacitive", one a method. See decoupling/capacitive/README.md for what is fitted and what is stated.
#pragma once
#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Curves of Cn and, where fx or fy is a component, of each electrode: linear least squares, readings from forces.
void fit_capacitive_quadratic(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// Zero and active capacitance of each electrode, compression law, shear stiffness and its exponent: robust non-linear least
// squares, readings from forces. overlap: geometry from calibration.parameters (all six or none: then an assumed one, with a
// warning).
void fit_capacitive_ratio(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);
void fit_capacitive_overlap(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

}  // namespace tactiled
