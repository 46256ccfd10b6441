// Friction limit: friction limits the shear on a skin.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

// The shear is reduced to mu * press, with the kinetic mu while the body slides; its direction is kept. Without a
// press there is no shear.
std::unique_ptr<Effect> make(const Setting& s) {
    return each_sample([friction = s.body.friction, kinetic = s.body.kinetic_friction](Block& block, std::size_t n) {
        auto& [fx, fy, fz, mx, my] = block.load;
        const double limit = (block.speed_m_s[n] > 0 ? kinetic : friction) * std::max(-fz[n], 0.0);
        const double shear = std::sqrt(fx[n] * fx[n] + fy[n] * fy[n]);
        if (shear <= limit * (1 + 1e-12)) return;  // a scene may request exactly the limit
        fx[n] *= limit / shear;
        fy[n] *= limit / shear;
    });
}

// Exact: the removed part is the excess of the scene's shear over friction. With an error before it: a projection on
// a disc whose radius is proportional to the press, so |change of the shear| <= |change of the shear before| + mu
// |change of the press|.
Bound bound(const Setting& s) {
    double excess = s.extent.shear_excess_N;
    if (s.extent.speed_m_s > 0) excess = std::max(excess, s.extent.kinetic_excess_N);
    if (excess <= 0) return {};
    Load change{}, more{};
    const Load error = observed(s.sensor);
    for (const Axis axis : {kFx, kFy}) {
        change[axis] = std::min(excess, s.extent.max[axis]);
        more[axis] = std::hypot(error[kFx], error[kFy]) + std::max(s.body.friction, s.body.kinetic_friction) * error[kFz];
    }
    return {.change_N = s.sensor.channel_N(change),
            .gain = 1 + s.sensor.channel_N(more),
            .load = change,
            .coupling = std::max({s.body.friction, s.body.kinetic_friction, 1.0})};
}

const EffectEntry entry{.name = "friction_limit",
                        .title = "friction limit",
                        .equation = "|T| <= mu N",
                        .source = "Coulomb",
                        .stage = Stage::contact,
                        .instructions = 30,
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
