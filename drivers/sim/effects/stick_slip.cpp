// Stick-slip: a slowly sliding body drags the skin along until static friction is exceeded, periodically.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"
#include "drivers/sim/effects/skin.hpp"

namespace tactiled::sim {
namespace {

// During sticking the shear rises by stiffness * speed. At the static friction it falls at once as far below the
// kinetic friction as it was above (no damping). The shear is therefore a sawtooth about the kinetic friction, whose
// phase is exact for any step. Its amplitude decreases with speed by Stribeck's curve.
std::unique_ptr<Effect> make(const Setting& s) {
    // place: 0 = just slipped, 1 = about to slip; at one half the change is 0
    return each_sample([kinetic = s.body.kinetic_friction, drop = std::max(s.body.friction - s.body.kinetic_friction, 0.0),
                        stribeck_m_s = s.p[0], rise = s.p[1] * skin(s.sensor).shear_N_m / s.rate_Hz,
                        place = 0.5](Block& block, std::size_t n) mutable {
        auto& [fx, fy, fz, mx, my] = block.load;
        const double press = -fz[n], speed = block.speed_m_s[n];
        const double relative = speed / stribeck_m_s, swing = drop * std::exp(-relative * relative) * press;
        if (speed <= 0 || press <= 0 || swing <= 0) {
            place = 0.5;
            return;
        }
        place += std::min(rise * speed / (2 * swing), 1e6);
        place -= std::floor(place);
        const double shear = std::sqrt(fx[n] * fx[n] + fy[n] * fy[n]), sliding = std::max(shear, kinetic * press);
        if (sliding <= 0) return;
        // The scene's shear may differ from the friction: the sawtooth is then scaled by their ratio.
        const double scale = std::max(1 + (2 * place - 1) * swing / sliding, 0.0);
        fx[n] *= scale;
        fy[n] *= scale;
    });
}

// |T| swing / max(|T|, mu_k N) is no more than swing, nor than |T| swing / (mu_k N).
Bound bound(const Setting& s) {
    const double drop = s.body.friction - s.body.kinetic_friction;
    if (s.extent.speed_m_s <= 0 || drop <= 0) return {};
    Load change{};
    for (const Axis axis : {kFx, kFy}) {
        change[axis] = drop * s.extent.max[kFz];
        if (s.body.kinetic_friction > 0)
            change[axis] = std::min(change[axis], s.extent.max[axis] * drop / s.body.kinetic_friction);
    }
    const double change_N = s.sensor.channel_N(change);
    // An error of the press changes the phase of the sawtooth.
    return {.change_N = change_N, .jump_N = 2 * change_N, .own_N = change_N, .load = change};
}

const EffectEntry entry{
    .name = "stick_slip",
    .title = "stick-slip",
    .equation = "T' = k v up to mu_s N, then falls to (2 mu_k - mu_s) N; mu_s - mu_k -> (mu_s - mu_k) exp(-(v / v_s)^2)",
    .source = "slider on a spring; Stribeck's curve as in Canudas de Wit et al. 1995",
    .stage = Stage::contact,
    .instructions = 140,
    .parameters = {{"stribeck_m_s", "speed at which static friction has gone to a third", 0.1, 1e-6, 100},
                   {"stiffness", "against shear, in that of the skin alone", 0.5, 1e-6, 1e3}},
    .bound = bound,
    .make = make};

}  // namespace
}  // namespace tactiled::sim
