// Quantisation: a converter has whole steps only.
#include "drivers/sim/effects/quantisation.hpp"

#include <cmath>

namespace tactiled::sim {
namespace {

double step(const Setting& s, std::size_t channel) {
    return std::isnan(s.p[0]) ? converter_step(s.sensor, channel) : s.p[0] * s.sensor.per_N[channel];
}

std::unique_ptr<Effect> make(const Setting& s) {
    return each_reading(s, [step = per_channel(s, [&](std::size_t k) { return step(s, k); })](double r, std::size_t k) {
        return step[k] > 0 ? std::floor(r / step[k] + 0.5) * step[k] : r;
    });
}

Bound bound(const Setting& s) {
    const Channels half = per_channel(s, [&](std::size_t k) { return step(s, k) / 2; });
    const double half_N = s.sensor.largest_N(half) * 1.000001;  // the rounding of the division
    return {.change_N = half_N, .jump_N = 2 * half_N, .own_N = half_N};
}

const EffectEntry entry{.name = "quantisation",
                        .title = "steps of the converter",
                        .equation = "r = step floor(r / step + 1/2)",
                        .source = "12 bit of a table's, 16 of a hair's, AD7746 4 aF, 10 bit of 5 V for the film",
                        .stage = Stage::converter,
                        .instructions = 210,
                        .models = kAll | kTaxel,
                        .parameters = {{"step_N", "by default by the sensor's model", kByModel, 0, 1e3}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
