// Fringe field: the part of a capacitance by the rim falls more slowly with the gap than the part by the plate.
#include <cmath>

#include "drivers/sim/effects/pad.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

constexpr double kWidest = 6;  // gap / radius beyond which the formula decreases again

// Kirchhoff's formula for a disc over its plate formula; for a sector, the disc of the same area. v = gap / radius.
double fringe(double v) {
    v = std::min(v, kWidest);
    return 1 + v / std::numbers::pi * (std::log(16 * std::numbers::pi / v) - 1);
}
double slope(double v) { return (std::log(16 * std::numbers::pi / std::min(v, kWidest)) - 2) / std::numbers::pi; }

std::unique_ptr<Effect> make(const Setting& s) {
    const Pad pad(s.sensor);
    std::array<double, Pad::kMax> at_rest{};
    for (std::size_t i = 0; i < pad.n; ++i) at_rest[i] = fringe(pad.gap_m / pad.radius_m[i]);
    return each_sample([pad, at_rest](Block& block, std::size_t n) {
        const double gap_m = pad.gap_m / Pad::closeness(pad.strain(block.drive[kFz][n]));
        double factor = 1;
        for (std::size_t i = 0; i < pad.n; ++i) {
            if (i == 0 || pad.radius_m[i] != pad.radius_m[i - 1]) factor = fringe(gap_m / pad.radius_m[i]) / at_rest[i];
            double& value = block.channel[pad.channel[i]][n];
            value = pad.rest_pF[i] + (value - pad.rest_pF[i]) * factor;
        }
    });
}

// The factor rises with the gap, with the steepest slope at the minimum gap.
Bound bound(const Setting& s) {
    const Pad pad(s.sensor);
    const double strain = pad.strain_per_N * max(s, kFz), narrow = 1 / Pad::closeness(strain), wide = 1 + strain;
    const auto swing = largest_swing(s);
    Channels change{};
    double gain = 1;
    for (std::size_t i = 0; i < pad.n; ++i) {
        const std::size_t k = pad.channel[i];
        const double v = pad.gap_m / pad.radius_m[i], rest = fringe(v), active = pad.active_pF[i] + swing[k];
        const double farthest = std::max(std::abs(fringe(v * narrow) - rest), std::abs(fringe(v * wide) - rest)) / rest;
        change[k] = active * farthest;
        const double by_N = slope(v * narrow) * v * pad.strain_per_N / rest;
        gain = std::max(gain, 1 + farthest + active * by_N * load_of_error(s.sensor, kFz) / s.sensor.per_N[k]);
    }
    return {.change_N = s.sensor.largest_N(change), .gain = gain};
}

const EffectEntry entry{.name = "fringe_field",
                        .title = "fringe field",
                        .equation = "C -> C f(d) / f(d0), f = 1 + d/(pi r) (ln(16 pi r / d) - 1)",
                        .source = "Kirchhoff 1877",
                        .stage = Stage::transducer,
                        .instructions = 260,
                        .models = kCapacitive,
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
