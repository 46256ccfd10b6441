// Nonlinearity of a quarter bridge: its output is x / (4 + 2 x) and is scaled as if it were x / 4.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// Applied to the change by the load only: slow changes of the resistance are balanced before.
std::unique_ptr<Effect> make(const Setting& s) {
    return each_reading(s, [zero = s.sensor.zero](double r, std::size_t k) {
        const double x = std::max(r - zero[k], -1.0);
        return zero[k] + x / (1 + x / 2);
    });
}

// Both x^2 / (2 + x) and the slope 1 / (1 + x/2)^2 are largest at the most negative x.
Bound bound(const Setting& s) {
    const auto swing = largest_swing(s);
    Channels change{};
    double gain = 1;
    for (std::size_t k = 0; k < s.sensor.n(); ++k) {
        const double x = std::min(swing[k], 1.0);
        change[k] = std::max(x * x / (2 - x), swing[k] * swing[k] / (2 + swing[k]));
        gain = std::max(gain, 1 / ((1 - x / 2) * (1 - x / 2)));
    }
    return {.change_N = s.sensor.largest_N(change), .gain = gain};
}

const EffectEntry entry{.name = "bridge_nonlinearity",
                        .title = "nonlinearity of a quarter bridge",
                        .equation = "r = x / (1 + x / 2)",
                        .source = "Wheatstone; 0.12 % for the hairs, 1.4 % for the table at full scale",
                        .stage = Stage::transducer,
                        .instructions = 150,
                        .models = kTable | kHair,
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
