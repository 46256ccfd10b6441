// The parts that the fits of model "capacitive" share. See decoupling/capacitive/README.md for what is fitted and what is
// stated.
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
// Zero and active capacitance of each electrode, compression law, shear stiffness and its exponent: robust non-linear least
// squares, readings from forces. `geometry`: nullptr = the overlap to first order; `pair_gain`: relative change of C1 by one
// unit of shift. All but the shear stiffness is put into the calibration. setup: throws Undetermined
FittedPad fit_pad(const Rows& rows, const ElectrodeGeometry* geometry, double pair_gain, Calibration& calibration,
                  std::vector<std::string>& warnings);

}  // namespace tactiled
