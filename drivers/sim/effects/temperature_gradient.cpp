// Temperature gradient: the gauges of one sensor do not have one temperature, and a dummy does not have theirs.
#include <cmath>
#include <numbers>

#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/warmth.hpp"

namespace tactiled::sim {
namespace {

struct Wave {
    Channels amplitude, phase;  // channel_unit, rad
    double rad_s;
};

Wave wave(const Setting& s) {
    return {per_channel(s, [&](std::size_t k) { return s.p[0] / 2 * drift_per_K(s, s.p[2], s.p[3], k); }),
            per_channel(s, [&](std::size_t k) { return 2 * std::numbers::pi * s.random.uniform(0, k); }),
            2 * std::numbers::pi / s.p[1]};
}

// Each channel is half of the difference warmer or colder than the sensor, in a phase of its own: two channels differ by the
// whole of it at most.
std::unique_ptr<Effect> make(const Setting& s) {
    return each_reading(s, [wave = wave(s)](double r, std::size_t k, const Block& block, std::size_t n) {
        return r + wave.amplitude[k] * std::sin(wave.rad_s * block.t_s[n] + wave.phase[k]);
    });
}

Bound bound(const Setting& s) {
    Bound result = bound_of_own(s, wave(s).amplitude);
    result.own_rate_N_s = result.change_N * wave(s).rad_s;
    return result;
}

const EffectEntry entry{.name = "temperature_gradient",
                        .title = "temperature gradient between gauges",
                        .equation = "r = r + alpha_k D/2 sin(2 pi t / P + phase_k)",
                        .source = "draught and the warmth of a motor: a bounded difference of any phase",
                        .stage = Stage::transducer,
                        .instructions = 250,
                        .models = kAll | kTaxel,
                        .parameters = {{"difference_K", "largest, between two channels; 0: one temperature", 0, 0, 100},
                                       {"period_s", "of its slow change", 20, 0.1, 1e6},
                                       {"per_K", "of R0 or C0; by default by the sensor's model", kByModel, -0.1, 0.1},
                                       {"mismatch", "standard deviation between channels, relative", 0.01, 0, 1}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
