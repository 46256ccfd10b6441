// Large deflection: a skin becomes stiffer the further it is pressed.
#include <cmath>

#include "drivers/sim/effects/axes.hpp"
#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/surrogate.hpp"

namespace tactiled::sim {
namespace {

// Strain, > 0 in compression, of a neo-Hookean pad under the load q = stress / modulus: with x = 1 / stretch, x^3 - 3
// q x - 1 = 0. Newton's method solves for e = x - 1, so that a load of 1e-12 keeps its digits.
double strain(double q) {
    double e = std::max(q, -1.0);
    for (int i = 0; i < 8; ++i) e -= (e * (e * (e + 3) + 3 * (1 - q)) - 3 * q) / (3 * (e * (e + 2) + (1 - q)) + 1e-300);
    return e / (1 + e);
}

// Strain per 1 N in the linear model of an elastomer; 0 for the table.
double strain_per_N(const Sensor& sensor) {
    if (sensor.model == Model::capacitive) return sensor.capacitive.strain_per_N;
    if (sensor.model == Model::hair) return 1 / (sensor.hair.area_m2 * sensor.hair.young_Pa);
    return 0;
}

// The table's plate by finite elements: 4.6 % less at 1 N, 25 % at 5 N, shear unchanged; a power law in between.
double plate(double u, double half_N) { return u / (1 + std::pow(std::abs(u) / half_N, 1.2)); }

std::unique_ptr<Effect> make(const Setting& s) {
    return each_drive(kPress, [half_N = s.p[0], per_N = strain_per_N(s.sensor)](double z, std::size_t) {
        return per_N > 0 ? -strain(-per_N * z) / per_N : plate(z, half_N);
    });
}

// The difference grows with the load. A pulled pad becomes softer: d strain / dq = 1 / (x (x^2 - q)), at most 3.
Bound bound(const Setting& s) {
    const double z = max(s, kFz), per_N = strain_per_N(s.sensor);
    if (z == 0) return {};
    if (per_N == 0) return bound_of_load(s, {0, 0, z - plate(z, s.p[0]), 0, 0});
    const double q = per_N * z, press = q - strain(q), pull = -q - strain(-q), x = 1 / (1 - strain(-q));
    return bound_of_load(s, {0, 0, std::max(press, pull) / per_N, 0, 0}, 1 / (x * (x * x + q)));
}

// The law of an elastomer as a polynomial of the force.
std::vector<Level> levels(const Setting& s) {
    const double per_N = strain_per_N(s.sensor), most_N = kBeyond * max(s, kFz);
    if (per_N == 0) return {};  // the power law of a plate has no polynomial at 0
    const Polynomial<7> yields([&](double z) { return -strain(-per_N * z) / per_N; }, -most_N, most_N);
    return {{"polynomial", s.sensor.channel_N({0, 0, yields.error(), 0, 0}), [yields](const Setting&) {
                 return each_drive(kPress, [yields](double z, std::size_t) { return yields(z); });
             }}};
}

const EffectEntry entry{.name = "large_deflection",
                        .title = "large deflection",
                        .equation = "elastomer: 3 q = 1/l^2 - l, strain = 1 - l; table: u / (1 + (|u| / half)^1.2)",
                        .source = "neo-Hookean law; table: own finite elements, -4.6 % at 1 N, -25 % at 5 N",
                        .stage = Stage::material,
                        .instructions = 150,
                        .parameters = {{"half_N", "press at which a table reads half", 12.5, 0.01, 1e6}},
                        .bound = bound,
                        .make = make,
                        .levels = levels,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
