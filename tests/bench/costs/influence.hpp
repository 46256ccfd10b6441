// Contacts at the points of a plate's influence map, for what is measured of method "map".
#pragma once
#include <string>
#include <vector>

#include "tests/bench/costs/cost.hpp"

namespace tactiled::ctl {

struct PlateContact {
    double x_m, y_m, force_N[3];
    std::vector<double> reading;  // R1 .. R8
};

// The calibration of method "map" that the setup names. setup: throws SetupError where it is none
Calibration influence_calibration(const CostSetup& setup);

// A press of 0.5 to 1 N with a shear of at most half of it at a row of the map's table, as the finite elements read it.
PlateContact contact_at_row(const Calibration& calibration, std::size_t row, std::size_t seed);

}  // namespace tactiled::ctl
