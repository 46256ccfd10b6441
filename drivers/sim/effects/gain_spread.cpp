// Spread of the channels: gauges and electrodes differ from each other.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// Relative standard deviation of a channel's gain. The thesis' two samples differ by 1.85 % in capacitance and 5.3 %
// in the film.
double sd(const Setting& s, std::size_t channel) {
    double spread = s.p[0];
    if (std::isnan(spread))
        spread = s.sensor.model != Model::capacitive ? 0.02 : s.sensor.channels[channel] == "Vp" ? 0.053 : 0.0185;
    return spread * s.sample.noise(0, channel);
}
double offset(const Setting& s, std::size_t channel) {
    return s.p[1] * s.sensor.per_N[channel] * s.sample.noise(1, channel);
}

std::unique_ptr<Effect> make(const Setting& s) {
    const Channels spread = per_channel(s, [&](std::size_t k) { return sd(s, k); });
    const Channels offsets = per_channel(s, [&](std::size_t k) { return offset(s, k) - s.sensor.zero[k] * spread[k]; });
    return each_reading(s, [spread, offsets](double r, std::size_t k) { return r + (spread[k] * r + offsets[k]); });
}

Bound bound(const Setting& s) {
    const auto swing = largest_swing(s);
    Channels change{};
    double max_sd = 0;
    for (std::size_t k = 0; k < s.sensor.n(); ++k) {
        change[k] = std::abs(sd(s, k)) * swing[k] + std::abs(offset(s, k));
        max_sd = std::max(max_sd, std::abs(sd(s, k)));
    }
    return {.change_N = s.sensor.largest_N(change), .gain = 1 + max_sd};
}

const EffectEntry entry{
    .name = "gain_spread",
    .title = "spread of gains and zeros",
    .equation = "r = zero + (1 + e_k) (r - zero) + o_k",
    .source = "thesis: 1.85 % and 5.3 % between samples",
    .stage = Stage::transducer,
    .instructions = 90,
    .models = kAll | kTaxel,
    .parameters = {{"deviation", "of the gains, relative; by default by the sensor's model", kByModel, 0, 0.2},
                   {"offset_N", "standard deviation of the zeros", 0, 0, 100}},
    .bound = bound,
    .make = make,
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
