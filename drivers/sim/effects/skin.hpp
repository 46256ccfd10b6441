// Properties of a sensor's skin and of the contact of two bodies, for the contact effects.
#pragma once
#include <algorithm>
#include <cmath>

#include "drivers/sim/motion.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

inline constexpr double kBodyPoisson = 0.3;

struct Skin {
    double young_Pa, poisson;
    double press_N_m, shear_N_m;  // force per metre, of the whole sensor
};

inline Skin skin(const Sensor& sensor) {
    if (sensor.model == Model::table) return {4.4e9, 0.22, 3e5, 3e5};  // SU-8; some um per N
    if (sensor.model == Model::hair) {
        const HairSample& hair = sensor.hair;
        const double area_over_height = hair.area_m2 / std::max(hair.height_m, 1e-6);
        return {hair.young_Pa, 0.49, hair.young_Pa * area_over_height, hair.young_Pa / 2.98 * area_over_height};
    }
    if (sensor.model == Model::taxel) return {sensor.taxel.young_Pa, 0.49, 1e9, 1e9};
    const CapacitiveSample& pad = sensor.capacitive;
    return {pad.young_Pa, pad.poisson, 1 / std::max(pad.strain_per_N * pad.gap_m, 1e-9),
            1 / std::max(pad.shift_per_N_m, 1e-9)};
}

// Hertz: 1 / E* = (1 - nu1^2) / E1 + (1 - nu2^2) / E2.
inline double contact_modulus_Pa(const Skin& skin, const Body& body) {
    return 1 / ((1 - skin.poisson * skin.poisson) / std::max(skin.young_Pa, 1.0) +
                (1 - kBodyPoisson * kBodyPoisson) / std::max(body.stiffness_Pa, 1.0));
}

// Radius for a sphere under press_N: a^3 = 3 F R / (4 E*), at most R.
inline double hertz_radius_m(double press_N, double radius_m, double modulus_Pa) {
    return std::min(std::cbrt(0.75 * std::max(press_N, 0.0) * radius_m / modulus_Pa), radius_m);
}

}  // namespace tactiled::sim
