// Mains hum: the mains frequency with its third and fifth harmonics, aliased by the sampling rate.
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

constexpr double kThird = 0.3, kFifth = 0.1;

double amplitude_N(const Setting& s) { return std::isnan(s.p[0]) ? 2e-4 * s.sensor.full_scale_N : s.p[0]; }

// The phase depends on the number of the sample: the converter's clock is exact compared with the drift of the mains.
std::unique_ptr<Effect> make(const Setting& s) {
    const Channels amplitude = per_channel(s, [&](std::size_t k) { return amplitude_N(s) * s.sensor.per_N[k]; });
    return each_sample([channels = s.sensor.n(), turns_per_sample = s.p[1] / s.rate_Hz, start = s.random.uniform(0),
                        amplitude](Block& block, std::size_t n) {
        const double turns = start + turns_per_sample * double(block.first + n);
        const double one = std::sin(6.283185307179586 * (turns - std::floor(turns))), square = one * one;
        const double third = one * (3 - 4 * square), fifth = one * (5 - square * (20 - 16 * square));
        const double wave = one + kThird * third + kFifth * fifth;
        for (std::size_t k = 0; k < channels; ++k) block.channel[k][n] += amplitude[k] * wave;
    });
}

// x + 0.3 (3 x - 4 x^3) + 0.1 (5 x - 20 x^3 + 16 x^5) is largest at x^2 = 0.355: 0.8733.
Bound bound(const Setting& s) {
    return bound_of_own(s, per_channel(s, [&](std::size_t k) { return 0.8734 * amplitude_N(s) * s.sensor.per_N[k]; }));
}

const EffectEntry entry{.name = "mains_hum",
                        .title = "mains hum",
                        .equation = "r = r + A (sin p + 0.3 sin 3 p + 0.1 sin 5 p), p = 2 pi f n / rate",
                        .source = "derived",
                        .stage = Stage::converter,
                        .instructions = 220,
                        .parameters = {{"amplitude_N", "by default 0.02 % of full scale", kByModel, 0, 100},
                                       {"frequency_Hz", "of the mains", 50, 0, 1e4}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
