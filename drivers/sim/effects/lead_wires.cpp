// Lead wires: their resistance is in series with the gauge and changes with temperature.
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

constexpr double kCopper_1_K = 3.9e-3;  // relative change of resistance per K

// Change of dR/R0. The constant part of the offset is balanced.
std::unique_ptr<Effect> make(const Setting& s) {
    return each_reading(s, [gain = 1 / (1 + s.p[0]), offset_1_K = s.p[0] * kCopper_1_K / (1 + s.p[0])](
                               double r, std::size_t, const Block& block, std::size_t n) {
        return gain * r + offset_1_K * block.ambient_K[n];
    });
}

Bound bound(const Setting& s) {
    Channels change = largest_swing(s);
    for (std::size_t k = 0; k < s.sensor.n(); ++k)
        change[k] =
            s.p[0] / (1 + s.p[0]) * (change[k] + std::abs(s.sensor.zero[k])) + s.p[0] * kCopper_1_K * s.extent.ambient_K;
    const double change_N = s.sensor.largest_N(change);
    return {.change_N = change_N, .own_N = s.extent.ambient_K > 0 ? change_N : 0};
}

const EffectEntry entry{.name = "lead_wires",
                        .title = "resistance of the lead wires",
                        .equation = "r = (r + w 3.9e-3/K dT) / (1 + w), w = r_wire / R",
                        .source = "derived; copper 3.9e-3 / K",
                        .stage = Stage::converter,
                        .instructions = 90,
                        .models = kTable | kHair,
                        .parameters = {{"share", "of the gauge's resistance", 1e-4, 0, 1}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
