// Johnson noise of the gauges' resistance, the minimum noise of a bridge.
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

// Standard deviation of dR/R0: voltage (4 k T R B)^(1/2) over a quarter bridge's V/4.
double sd(const Setting& s) {
    const double band_Hz = s.rate_Hz / 2;
    return std::sqrt(4 * 1.380649e-23 * 298.15 * s.p[0] * band_Hz) / (s.p[1] / 4);
}

std::unique_ptr<Effect> make(const Setting& s) {
    return each_reading(s, [random = s.random, sd = sd(s)](double r, std::size_t k, const Block& block, std::size_t n) {
        return r + sd * random.noise(block.first + n, k);
    });
}

Bound bound(const Setting& s) {
    return bound_of_own(s, per_channel(s, [&](std::size_t) { return kMaxNoise * sd(s); }));
}

const EffectEntry entry{
    .name = "johnson_noise",
    .title = "Johnson noise of the gauges",
    .equation = "sigma_V^2 = 4 k T R B, sigma_r = 4 sigma_V / V",
    .source = "Johnson 1928, Nyquist 1928; 0.13 uV of 1 kOhm over 1 kHz",
    .stage = Stage::converter,
    .instructions = 390,
    .models = kTable | kHair,
    .parameters = {{"resistance_ohm", "of a gauge", 1000, 0, 1e9}, {"excitation_V", "of the bridge", 3.3, 1e-3, 100}},
    .bound = bound,
    .make = make,
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
