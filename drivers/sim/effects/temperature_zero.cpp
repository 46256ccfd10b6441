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
    Channels change{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) change[k] = drift_per_K(s, s.p[0], s.p[1], k) * s.extent.ambient_K;
    const double change_N = s.sensor.largest_N(change);
    const double rate_N_s = s.extent.ambient_K > 0 ? change_N / s.extent.ambient_K * s.extent.ambient_rate_K_s : 0;
    return {.change_N = change_N, .own_N = change_N, .own_rate_N_s = rate_N_s};
}

const EffectEntry entry{.name = "temperature_zero",
                        .title = "zero by temperature",
                        .equation = "r = r + alpha_k dT",
                        .source = "handbook values of Ni-Cr, platinum, silicone",
                        .stage = Stage::transducer,
                        .cost_class = "c0",
                        .instructions = 70,
                        .models = kAll,
                        .parameters = {{"per_K", "of R0 or C0; by default by the sensor's model",
                                        std::numeric_limits<double>::quiet_NaN(), -0.1, 0.1},
                                       {"mismatch", "standard deviation between channels, relative", 0.01, 0, 1}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
