// Clock drift: the sensor's clock runs fast or slow.
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    return each_sample([error = s.p[0] * 1e-6](Block& block, std::size_t n) { block.t_s[n] += error * block.t_s[n]; });
}

Bound bound(const Setting& s) {
    const double length_s = std::max(s.extent.length_s, double(s.samples) / s.rate_Hz);
    const double drift = std::abs(s.p[0]) * 1e-6;
    return {.change_N = shift_N(s, drift * length_s), .stretch = 1 + drift};
}

const EffectEntry entry{.name = "clock_drift",
                        .title = "drift of the sampling clock",
                        .equation = "t = t (1 + ppm 1e-6)",
                        .source = "quartz: 20 to 100 ppm",
                        .stage = Stage::time,
                        .instructions = 11,
                        .models = kAll | kTaxel,
                        .parameters = {{"drift_ppm", "> 0: samples come late", 50, -1e4, 1e4}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
