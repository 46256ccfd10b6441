// Bonded layer: a thin pad that is bonded on both faces can bulge only at its rim, the less the thinner it has
// become.
#include <cmath>

#include "drivers/sim/effects/axes.hpp"
#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/surrogate.hpp"

namespace tactiled::sim {
namespace {

// The pad at rest already has its bonded modulus E (1 + 2 S^2), S = R / 2t, because strain_per_N is measured. The
// remaining effect is that S rises under a press: N = K/3 (c^2 - 1/c) c^p, c = gap at rest / gap. The drive becomes N
// c^-p, the input that the neo-Hookean law then needs. p = 0.14 reproduces finite elements of a pad with S = 1 to 1 %
// from 2 to 20 N.
double softer(double N, double strain_per_N, double power) {
    if (!(N > 0)) return N;
    double reduced = N, c = 1;
    for (int pass = 0; pass < 3; ++pass) {
        const double q = strain_per_N * reduced;
        c = 1 + q;
        for (int i = 0; i < 6; ++i) c -= (c * (c * c - 3 * q) - 1) / (3 * (c * c - q));
        reduced = N * std::pow(c, -power);
    }
    return reduced;
}

std::unique_ptr<Effect> make(const Setting& s) {
    return each_drive(kPress, [per_N = s.sensor.capacitive.strain_per_N, power = s.p[0]](double z, std::size_t) {
        return -softer(-z, per_N, power);
    });
}

// N (1 - c^-p) grows with N and more slowly than N.
Bound bound(const Setting& s) {
    const double z = max(s, kFz);
    return bound_of_load(s, {0, 0, z - softer(z, s.sensor.capacitive.strain_per_N, s.p[0]), 0, 0});
}

// Approximates a press by a polynomial; a pull is unchanged.
std::vector<Level> levels(const Setting& s) {
    const double per_N = s.sensor.capacitive.strain_per_N, power = s.p[0];
    const Polynomial<6> softened([&](double N) { return softer(N, per_N, power); }, 0, kBeyond * max(s, kFz));
    return {{"polynomial", s.sensor.channel_N({0, 0, softened.error(), 0, 0}), [softened](const Setting&) {
                 return each_drive(kPress, [softened](double z, std::size_t) { return z < 0 ? -softened(-z) : z; });
             }}};
}

const EffectEntry entry{.name = "bonded_layer",
                        .title = "bonded layer",
                        .equation = "N = K/3 (c^2 - 1/c) c^p, c = gap at rest / gap",
                        .source = "Gent, Lindley 1959: E (1 + 2 S^2); its rise under a press by own finite elements",
                        .stage = Stage::material,
                        .instructions = 680,
                        .models = kCapacitive,
                        .parameters = {{"power", "p; 0.14 where the pad is four times as wide as thick", 0.14, 0, 1}},
                        .bound = bound,
                        .make = make,
                        .levels = levels,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
