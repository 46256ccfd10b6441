// Calibrations of model "hair". Forwards, hair by hair: the noise is in the readings. Rows that contradict the rest (swapped
// labels) lose their weight (Cauchy).
//
// Taken from `calibration.parameters` where they are there, else the documents' values: area_m2 (a cap of 6 mm diameter),
// and for physics the geometry and elastomer (HairPhysics). setup: throws Undetermined
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/hair/physics.hpp"

namespace tactiled {

inline constexpr double kHairCapArea_m2 = 2.827433388230814e-5;  // pi (3 mm)^2

// Parameters diff_x_per_Pa, diff_y_per_Pa; tables gains, intercept, noise.
void fit_hair_sum_diff(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);
// Tables gains, leak, noise.
void fit_hair_matrix(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);
// Parameters correction_normal, correction_shear; tables hair_gain, noise.
void fit_hair_physics(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// The parameters of method physics for a named elastomer of kElastomers, the rest as in `start`; for the
// `calibration.parameters` before fit_hair_physics. setup: throws SetupError where the name is none
std::map<std::string, double> hair_parameters(std::string_view elastomer, const HairPhysics& start = {});

}  // namespace tactiled
