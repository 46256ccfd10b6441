// The common parts of the fits of model "capacitive". decoupling/capacitive/README.md lists the fitted and the stated
// parameters.
#pragma once
#include <array>

#include "decoupling/fit/capacitive_model.hpp"
#include "decoupling/fit/fit.hpp"

namespace tactiled {

bool is_electrode(std::string_view name);
inline constexpr std::string_view kElectrodeOfPad = "an electrode of model \"capacitive\" (C1 .. C4, Cn)";

struct FittedPad {
    std::array<double, kUnknowns> p;
    double noise, condition;
};
// Fits zero and active capacitance of each electrode, compression law, shear stiffness and its exponent by robust non-linear
// least squares, readings from forces. `geometry`: nullptr = the overlap to first order; `pair_gain`: relative change of C1
// per unit of shift. Everything except the shear stiffness is stored in the calibration. setup: throws Undetermined
FittedPad fit_pad(const Rows& rows, const ElectrodeGeometry* geometry, double pair_gain, Calibration& calibration,
                  std::vector<std::string>& warnings);

}  // namespace tactiled
