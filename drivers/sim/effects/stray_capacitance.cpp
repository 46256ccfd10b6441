// Stray capacitance: a cable that moves changes the capacitance in parallel with each electrode.
#include <cmath>

#include "drivers/sim/effects/band_noise.hpp"
#include "drivers/sim/effects/pad.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    return each_block(
        [pad = Pad(s.sensor), sd_pF = s.p[0], noise = BandNoise(s.random, s.rate_Hz, s.p[1])](Block& block) mutable {
            for (std::size_t i = 0; i < pad.n; ++i)
                for (std::size_t n = 0; n < block.n; ++n)
                    block.channel[pad.channel[i]][n] += sd_pF * noise.at(block.first + n, i);
        });
}

Bound bound(const Setting& s) {
    const Pad pad(s.sensor);
    const BandNoise noise(s.random, s.rate_Hz, s.p[1]);
    Channels change{};
    for (std::size_t i = 0; i < pad.n; ++i) change[pad.channel[i]] = s.p[0] * noise.max(s.samples, i);
    return bound_of_own(s, change);
}

const EffectEntry entry{
    .name = "stray_capacitance",
    .title = "stray capacitance of a moving cable",
    .equation = "C = C + sigma n(t), n below a frequency",
    .source = "derived: at least 0.37 pF of the thesis' capacitance is stray",
    .stage = Stage::transducer,
    .instructions = 190,
    .models = kCapacitive,
    .parameters = {{"deviation_pF", "one standard deviation", 1e-3, 0, 10}, {"frequency_Hz", "highest", 2, 1e-3, 1e5}},
    .bound = bound,
    .make = make};

}  // namespace
}  // namespace tactiled::sim
