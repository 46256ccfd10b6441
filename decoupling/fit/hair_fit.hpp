// The common parts of the fits of model "hair". Each hair is fitted as reading from loads, because the noise is in
// the readings. Rows that contradict the rest (swapped labels) lose their weight (Cauchy).
#pragma once
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/hair_rows.hpp"
#include "decoupling/hair/physics.hpp"

namespace tactiled {

inline constexpr double kHairCapArea_m2 = 2.827433388230814e-5;  // pi (3 mm)^2

bool is_hair(std::string_view name);
inline constexpr std::string_view kHair = "a hair of model \"hair\" (H1 .. H4)";
inline constexpr const char* kHairUnit = "dR/R0";

// Returns the parameter area_m2 if it is stated, else kHairCapArea_m2. setup: throws Undetermined
double cap_area_m2(const Calibration& calibration);

// Fits each hair of the session and stores zero, noise and condition in the calibration. `first`: the first leak term
// that may be used; kLeakTerms = none. setup: throws Undetermined
std::vector<HairFit> fit_hairs(const HairSession& session, Calibration& calibration, std::size_t first,
                               std::vector<std::string>& warnings);
// Stores area and ranges as parameters, and gains and leak terms from `first` on in the tables of these names.
void store_scales(const HairSession& session, double area_m2, Calibration& calibration);
void store_response(const HairSession& session, const std::vector<HairFit>& hairs, std::size_t first, const char* name,
                    Calibration& calibration);

// Returns the parameters of method physics for a named elastomer of kElastomers, the rest as in `start`; for the
// `calibration.parameters` before the fit. setup: throws SetupError for an unknown name
std::map<std::string, double> hair_parameters(std::string_view elastomer, const HairPhysics& start = {});

}  // namespace tactiled
