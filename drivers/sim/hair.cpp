// Hair cantilevers in an elastomer cap: H1 .. H4, and a dummy H0 (Cao et al., Soft Sci 2023;3:32).
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {
namespace {

// Cao et al., per hair at 750 kPa. The values that they state for the sensor are SUM and DIFF of two hairs, twice as
// much.
constexpr double kNormal_per_Pa = 3.74e-7, kShear_per_Pa = 7.91e-7, kReference_Pa = 750e3;
constexpr double kArc_m = 0.7162e-3;         // radius of a hair of 1.5 mm over 120 degrees
constexpr double kReferenceRoot_m = 1.2e-3;  // not in the paper; between the radii of the finite elements

// The part of a press's gain that depends on the distance L of the root from the middle: the elastomer is displaced
// outwards by mu (sigma / E) (L + 3^(1/2) / 2 R) (Cao et al., eq. 8; the first coefficient as derived from eqs. 9 to
// 12, not as printed in eq. 13).
double normal_shape(double root_m) {
    const double first = 27 * (3 * std::numbers::sqrt3 - 4) / 16;
    return first * kArc_m + 19.0 / 8 * 0.49 * (root_m + std::numbers::sqrt3 / 2 * kArc_m);
}

}  // namespace

void read_hair(Options& options, Sensor& sensor) {
    HairSample& h = sensor.hair;
    h.area_m2 = options.number("area_m2", {1e-9, 1}, 2.827e-5);  // a cap of 6 mm
    h.height_m = options.number("height_m", {1e-5, 0.1}, 1e-3);
    h.young_Pa = options.number("young_Pa", {1e3, 1e9}, kReference_Pa);
    h.reference_young_Pa = kReference_Pa;
    h.root_distance_m = options.number("root_distance_m", {0, 0.01}, kReferenceRoot_m);
    // A cap that is twice as soft has twice the strain. This is exact as long as the hairs do not support the
    // elastomer.
    const double softer = h.reference_young_Pa / h.young_Pa;
    const double normal = options.number("normal_per_Pa", {0, 1}, kNormal_per_Pa) * softer *
                          normal_shape(h.root_distance_m) / normal_shape(kReferenceRoot_m);
    const double shear = options.number("shear_per_Pa", {0, 1}, kShear_per_Pa) * softer;
    sensor.unit = "dR/R0";
    constexpr double kTowards[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    for (std::size_t k = 0; k < HairSample::kHairs; ++k) {
        sensor.channels.push_back(fmt::format("H{}", k + 1));
        sensor.gain[k][kFx] = -shear / h.area_m2 * kTowards[k][0];
        sensor.gain[k][kFy] = -shear / h.area_m2 * kTowards[k][1];
        sensor.gain[k][kFz] = -normal / h.area_m2;
    }
    if (options.flag("dummy", false)) sensor.channels.push_back("H0");
    sensor.full_scale_N = 2000 * h.area_m2;  // 2 kPa
    sensor.resolution_N = 7.2 * h.area_m2;   // 7.2 Pa, the paper's threshold for a press
}

}  // namespace tactiled::sim
