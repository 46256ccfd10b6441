// Partial slip: before a round body slides, its rim slides and its middle yields to the shear.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"
#include "drivers/sim/effects/skin.hpp"

namespace tactiled::sim {
namespace {

// Compliance from (2 - nu) / G of the skin and of the body, 3 / 16 of the sum.
double compliance(const Setting& s) {
    const Skin skin_ = skin(s.sensor);
    const auto one = [](double young_Pa, double poisson) {
        return (2 - poisson) * 2 * (1 + poisson) / std::max(young_Pa, 1.0);
    };
    return 3.0 / 16 * (one(skin_.young_Pa, skin_.poisson) + one(s.body.stiffness_Pa, kBodyPoisson));
}

// The press moves with the body, so its moment about the sensor's origin changes by press * displacement.
std::unique_ptr<Effect> make(const Setting& s) {
    return each_sample([friction = s.body.friction, radius_m = s.body.shape == Body::Shape::sphere ? s.body.radius_m : 0,
                        modulus_Pa = contact_modulus_Pa(skin(s.sensor), s.body),
                        compliance = compliance(s)](Block& block, std::size_t n) {
        auto& [fx, fy, fz, mx, my] = block.load;
        const double press = -fz[n], shear = std::sqrt(fx[n] * fx[n] + fy[n] * fy[n]);
        const double a = hertz_radius_m(press, radius_m, modulus_Pa);
        if (a <= 0 || shear <= 0) return;
        const double stuck = std::cbrt(std::max(1 - shear / (friction * press), 0.0));  // radius of the sticking part over a
        const double moved_m = friction * press / a * compliance * (1 - stuck * stuck);
        mx[n] -= press * moved_m * fy[n] / shear;
        my[n] += press * moved_m * fx[n] / shear;
    });
}

// 1 - (1 - t)^(2/3) <= t, so displacement <= compliance * shear / a; multiplied by the press, it grows with both.
Bound bound(const Setting& s) {
    if (s.body.shape != Body::Shape::sphere || s.body.radius_m <= 0 || s.body.friction <= 0) return {};
    const double press = s.extent.max[kFz];
    const double a = hertz_radius_m(press, s.body.radius_m, contact_modulus_Pa(skin(s.sensor), s.body));
    if (a <= 0) return {};
    Load change{};
    const double limit = s.body.friction * press, per_shear = compliance(s) / a * press;
    change[kMx] = per_shear * std::min(s.extent.max[kFy], limit);
    change[kMy] = per_shear * std::min(s.extent.max[kFx], limit);
    const double change_N = s.sensor.channel_N(change);
    return {.change_N = change_N, .jump_N = 2 * change_N, .own_N = change_N, .load = change};
}

const EffectEntry entry{.name = "partial_slip",
                        .title = "partial slip under a round body",
                        .equation = "d = 3 mu N / (16 a) ((2-nu1)/G1 + (2-nu2)/G2) (1 - (1 - T/(mu N))^(2/3)); M = M + N d",
                        .source = "Cattaneo 1938, Mindlin 1949; Johnson, Contact Mechanics, 7.2",
                        .stage = Stage::contact,
                        .instructions = 80,
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
