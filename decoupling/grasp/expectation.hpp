// The standard deviation of weights before the first grasp: the estimator weighs an ideal grasp with the standard deviations
// of the sensors, so that the result follows its rules.
#pragma once
#include <array>
#include <vector>

#include "decoupling/grasp/grasp.hpp"

namespace tactiled::grasp {

// The accuracy of a jaw's sensor, per component fx fy fz: sd = hypot(sd_N, sd_slope * |component|).
struct JawAccuracy {
    std::array<double, 3> sd_N{}, sd_slope{};
};

struct ExpectedWeight {
    double mass_kg = 0, press_N = 0;  // an object, and the press of each jaw: the recommended grip
    double sd_kg = kNaN;              // NaN: the weight would not become stable
    double sd_known_kg = kNaN;        // after a known weight of known_kg was shown
    double known_kg = 0;
};

// Weighs an object of half of the mass that full scale permits (0.5 kg if unknown), and an object of a fifth of that. The
// palm looks down if gravity is not known. The result is empty if no jaw carries weight. setup: allocates
std::vector<ExpectedWeight> expected_weights(Setup setup, const std::vector<JawAccuracy>& accuracy);

}  // namespace tactiled::grasp
