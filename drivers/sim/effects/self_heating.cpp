// Self-heating: the measuring current warms the gauges from the scene's beginning, when it is switched on.
#include <cmath>

#include "drivers/sim/effects/approach.hpp"
#include "drivers/sim/effects/warmth.hpp"

namespace tactiled::sim {
namespace {

Channels per_K(const Setting& s) {
    return per_channel(s, [&](std::size_t k) { return drift_per_K(s, s.p[2], s.p[3], k); });
}

const EffectEntry entry{.name = "self_heating",
                        .title = "self-heating of the gauges",
                        .equation = "r = r + alpha_k T, T' = (V^2 / R R_thermal - T) / tau",
                        .source = "Joule's heat through one thermal resistance",
                        .stage = Stage::transducer,
                        .instructions = 90,
                        .models = kTable | kHair,
                        .parameters = {{"rise_K", "in the end: V^2 / R times the thermal resistance", 0.1, 0, 100},
                                       {"time_s", "tau", 20, 1e-3, 1e5},
                                       {"per_K", "of R0; by default by the sensor's model", kByModel, -0.1, 0.1},
                                       {"mismatch", "standard deviation between channels, relative", 0.01, 0, 1}},
                        .bound = [](const Setting& s) { return approach_bound(s, per_K(s)); },
                        .make = [](const Setting& s) { return approach(s, per_K(s)); }};

}  // namespace
}  // namespace tactiled::sim
