// Sampling jitter: a sample is taken a little before or after its time.
#include <algorithm>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    // max_s: two samples never change their order
    return each_sample([random = s.random, sd_s = s.p[0], max_s = 0.49 / s.rate_Hz](Block& block, std::size_t n) {
        block.t_s[n] += std::clamp(sd_s * random.noise(block.first + n), -max_s, max_s);
    });
}

Bound bound(const Setting& s) {
    const double late_s = std::min(kMaxNoise * s.p[0], 0.49 / s.rate_Hz);
    return {.change_N = shift_N(s, late_s), .slack_s = 2 * late_s};  // one sample early, the other late
}

const EffectEntry entry{.name = "sampling_jitter",
                        .title = "jitter of the sampling clock",
                        .equation = "t = t + sigma n",
                        .source = "derived: error = rate of change * sigma",
                        .stage = Stage::time,
                        .instructions = 60,
                        .models = kAll | kTaxel,
                        .parameters = {{"deviation_s", "one standard deviation", 1e-6, 0, 1e-2}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
