// Zero by temperature: gauges and pads at rest change with the room's temperature.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/warmth.hpp"

namespace tactiled::sim {
namespace {

Channels per_K(const Setting& s) {
    return per_channel(s, [&](std::size_t k) { return drift_per_K(s, s.p[0], s.p[1], k); });
}

std::unique_ptr<Effect> make(const Setting& s) {
    return each_reading(s, [per_K = per_K(s)](double r, std::size_t k, const Block& block, std::size_t n) {
        return r + per_K[k] * block.ambient_K[n];
    });
}

Bound bound(const Setting& s) {
    Channels change = per_K(s);
    for (double& c : change) c *= s.extent.ambient_K;
    Bound result = bound_of_own(s, change);
    result.own_rate_N_s = s.extent.ambient_K > 0 ? result.change_N / s.extent.ambient_K * s.extent.ambient_rate_K_s : 0;
    return result;
}

const EffectEntry entry{.name = "temperature_zero",
                        .title = "zero by temperature",
                        .equation = "r = r + alpha_k dT",
                        .source = "handbook values of Ni-Cr, platinum, silicone",
                        .stage = Stage::transducer,
                        .instructions = 70,
                        .models = kAll | kTaxel,
                        .parameters = {{"per_K", "of R0 or C0; by default by the sensor's model", kByModel, -0.1, 0.1},
                                       {"mismatch", "standard deviation between channels, relative", 0.01, 0, 1}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
