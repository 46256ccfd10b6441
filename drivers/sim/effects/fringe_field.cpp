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

class FringeField final : public Effect {
public:
    explicit FringeField(const Setting& s) : pad_(s.sensor) {
        for (std::size_t i = 0; i < pad_.n; ++i) at_rest_[i] = fringe(pad_.gap_m / pad_.radius_m[i]);
    }
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n) {
            const double gap_m = pad_.gap_m / Pad::closeness(pad_.strain(block.drive[kFz][n]));
            double factor = 1;
            for (std::size_t i = 0; i < pad_.n; ++i) {
                if (i == 0 || pad_.radius_m[i] != pad_.radius_m[i - 1])
                    factor = fringe(gap_m / pad_.radius_m[i]) / at_rest_[i];
                double& value = block.channel[pad_.channel[i]][n];
                value = pad_.rest_pF[i] + (value - pad_.rest_pF[i]) * factor;
            }
        }
    }

private:
    Pad pad_;
    std::array<double, Pad::kMax> at_rest_{};
};

// The factor rises with the gap, with the steepest slope at the minimum gap.
Bound bound(const Setting& s) {
    const Pad pad(s.sensor);
    const double strain = pad.strain_per_N * max(s, kFz), narrow = 1 / Pad::closeness(strain), wide = 1 + strain;
    const auto swing = largest_swing(s);
    std::array<double, kMaxSensorChannels> change{};
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
                        .cost_class = "c1",
                        .instructions = 260,
                        .models = kCapacitive,
                        .parameters = {},
                        .bound = bound,
                        .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<FringeField>(s); },
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
