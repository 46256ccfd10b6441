// White noise of the amplifier and the converter.
#include <array>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

// Standard deviation in the channel's unit. Cao et al. state 5.14e-6 for the hairs; load cells with an HX711 show
// 0.025 to 0.043 % of full scale.
double sd(const Setting& s, std::size_t channel) {
    if (!std::isnan(s.p[0])) return s.p[0] * s.sensor.per_N[channel];
    if (s.sensor.model == Model::hair) return 5.14e-6;
    return 3e-4 * s.sensor.full_scale_N * s.sensor.per_N[channel];
}

std::unique_ptr<Effect> make(const Setting& s) {
    return each_reading(s, [random = s.random, sd = per_channel(s, [&](std::size_t k) { return sd(s, k); })](
                               double r, std::size_t k, const Block& block, std::size_t n) {
        return r + sd[k] * random.noise(block.first + n, k);
    });
}

Bound bound(const Setting& s) {
    return bound_of_own(s, per_channel(s, [&](std::size_t k) { return kMaxNoise * sd(s, k); }));
}

const EffectEntry entry{
    .name = "noise",
    .title = "white noise",
    .equation = "r = r + sigma n",
    .source = "Cao et al. 2023: 5.14e-6; recorded load cells: 0.025 to 0.043 % of full scale",
    .stage = Stage::converter,
    .instructions = 380,
    .models = kAll | kTaxel,
    .parameters = {{"deviation_N", "one standard deviation; by default by the sensor's model", kByModel, 0, 100}},
    .bound = bound,
    .make = make,
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
