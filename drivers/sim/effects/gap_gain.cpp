// Gap gain: a capacitance, and its change by a shear, is inversely proportional to the gap.
#include <cmath>

#include "drivers/sim/effects/pad.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    return each_sample([gain = s.sensor.gain, pad = Pad(s.sensor)](Block& block, std::size_t n) {
        const double fz = block.drive[kFz][n], closeness = Pad::closeness(pad.strain(fz));
        for (std::size_t i = 0; i < pad.n; ++i) {
            double& value = block.channel[pad.channel[i]][n];
            const double unpressed = value - pad.rest_pF[i] - gain[pad.channel[i]][kFz] * fz;
            value = pad.rest_pF[i] + unpressed * closeness;
        }
    });
}

// With the strain e, c = 1 / (1 - e) and m the relative change by shift and tilt: (c - 1 - e) + m (c - 1), times the active
// part. Its slope by e is (1 + m) c^2, by m it is c.
Bound bound(const Setting& s) {
    const Pad pad(s.sensor);
    const double strain = pad.strain_per_N * max(s, kFz), c = Pad::closeness(strain);
    const double shift = pad.shift_per_N_m * std::hypot(max(s, kFx), max(s, kFy));
    Channels change{};
    double gain = 1;
    for (std::size_t i = 0; i < pad.n; ++i) {
        const auto& per_N = s.sensor.gain[pad.channel[i]];
        const double linear = (std::abs(per_N[kFx]) * max(s, kFx) + std::abs(per_N[kFy]) * max(s, kFy)) / pad.active_pF[i];
        const double tilt = pad.tilt_strain(i, std::min(s.extent.x_m, pad.disc_m), std::min(s.extent.y_m, pad.disc_m));
        const double moved = std::max(linear, pad.largest_overlap(i, shift)) + tilt * max(s, kFz);
        const double straight = std::max(std::min(strain, Pad::kMaxStrain) * (c - 1), std::abs(c - 1 - strain));
        change[pad.channel[i]] = pad.active_pF[i] * (straight + moved * (c - 1));
        gain = std::max(gain, (1 + moved) * c * c);
    }
    return {.change_N = s.sensor.largest_N(change), .gain = gain};
}

const EffectEntry entry{.name = "gap_gain",
                        .title = "inverse of the gap",
                        .equation = "C = stray + eps A / d, d = d0 (1 - strain)",
                        .source = "thesis, eq. XVII; its shear gain with 1/d: derived",
                        .stage = Stage::transducer,
                        .instructions = 140,
                        .models = kCapacitive,
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
