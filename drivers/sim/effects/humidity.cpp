// Humidity: carriers swell and permittivities rise while a skin absorbs moisture.
#include <cmath>

#include "drivers/sim/effects/approach.hpp"

namespace tactiled::sim {
namespace {

// Change of channel k per 1 % of relative humidity, in its unit. Polyimide swells by 9e-6 per percent; moist air,
// board and cable add 1e-4 of the capacitance.
double per_percent(const Setting& s, std::size_t k) {
    if (s.sensor.channels[k] == "Vp") return 0;
    if (s.sensor.model == Model::table) return (std::isnan(s.p[2]) ? 9e-6 : s.p[2]) * s.sensor.table.gauge_factor_tangential;
    return (std::isnan(s.p[2]) ? 1e-4 : s.p[2]) * s.sensor.zero[k];
}

// The humidity of the air changes at the scene's beginning and the skin follows.
Channels per_percent(const Setting& s) {
    return per_channel(s, [&](std::size_t k) { return per_percent(s, k); });
}

const EffectEntry entry{
    .name = "humidity",
    .title = "humidity",
    .equation = "r = r + b_k H, H' = (change - H) / tau",
    .source = "polyimide: hygroscopic expansion of 9 ppm per percent",
    .stage = Stage::transducer,
    .instructions = 90,
    .models = kTable | kCapacitive,
    .parameters = {{"change_percent", "of the relative humidity, at the scene's beginning", 2, -100, 100},
                   {"time_s", "tau, in which the skin takes it up", 300, 0.1, 1e6},
                   {"per_percent", "strain, or of C0; by default by the sensor's model", kByModel, 0, 0.01}},
    .bound = [](const Setting& s) { return approach_bound(s, per_percent(s)); },
    .make = [](const Setting& s) { return approach(s, per_percent(s)); }};

}  // namespace
}  // namespace tactiled::sim
