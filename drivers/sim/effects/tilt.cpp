// Tilt: the mean of 1/d over a tilted electrode is larger than 1 over the mean gap.
#include <cmath>

#include "drivers/sim/effects/pad.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

constexpr double kMaxTilt = 0.95;  // share of the tilt at which the rim touches

// Factor for a disc, k = radius * tilt / gap: 2 (1 - (1 - k^2)^(1/2)) / k^2 without its cancellation.
double factor(double k) { return 2 / (1 + std::sqrt(1 - std::min(k, kMaxTilt) * std::min(k, kMaxTilt))); }

// The upper electrode is tilted by an angle towards +x from the start, and tilts further under an eccentric press.
std::unique_ptr<Effect> make(const Setting& s) {
    const Pad pad(s.sensor);
    std::array<double, Pad::kMax> at_rest{};
    for (std::size_t i = 0; i < pad.n; ++i) at_rest[i] = factor(pad.radius_m[i] * s.p[0] / pad.gap_m);
    return each_sample([pad, mounted_rad = s.p[0], at_rest](Block& block, std::size_t n) {
        const double N = -block.drive[kFz][n], tilt = pad.tilt_rad_per_Nm * N;
        const double x = std::clamp(block.x_m[n], -pad.disc_m, pad.disc_m);
        const double y = std::clamp(block.y_m[n], -pad.disc_m, pad.disc_m);
        const double angle = std::hypot(mounted_rad + tilt * x, tilt * y);
        const double per_gap = Pad::closeness(pad.strain_per_N * N) / pad.gap_m;
        for (std::size_t i = 0; i < pad.n; ++i) {
            double& value = block.channel[pad.channel[i]][n];
            value = pad.rest_pF[i] + (value - pad.rest_pF[i]) * (factor(pad.radius_m[i] * angle * per_gap) / at_rest[i]);
        }
    });
}

// The factor is between that of the smallest angle at the largest gap and that of the largest angle at the smallest
// gap.
Bound bound(const Setting& s) {
    const Pad pad(s.sensor);
    const double N = max(s, kFz), mounted = s.p[0];
    const double reach = std::hypot(std::min(s.extent.x_m, pad.disc_m), std::min(s.extent.y_m, pad.disc_m));
    const double turn = pad.tilt_rad_per_Nm * N * reach, c = Pad::closeness(pad.strain_per_N * N);
    const auto swing = largest_swing(s);
    Channels change{};
    double gain = 1;
    for (std::size_t i = 0; i < pad.n; ++i) {
        const std::size_t k = pad.channel[i];
        const double per_rad = pad.radius_m[i] / pad.gap_m, rest = factor(per_rad * mounted);
        const double steepest = std::min(per_rad * (mounted + turn) * c, kMaxTilt),
                     root = std::sqrt(1 - steepest * steepest);
        const double max_factor = factor(steepest) / rest;
        const double min_factor =
            factor(per_rad * std::max(0.0, mounted - turn) * Pad::closeness(-pad.strain_per_N * N)) / rest;
        const double active = pad.active_pF[i] + swing[k];
        change[k] = active * std::max(max_factor - 1, 1 - min_factor);
        const double by_k = 2 * steepest / (root * (1 + root) * (1 + root)) / rest;
        const double k_by_N = per_rad * c * (pad.tilt_rad_per_Nm * reach + (mounted + turn) * pad.strain_per_N * c);
        gain = std::max(gain, max_factor + active * by_k * k_by_N * load_of_error(s.sensor, kFz) / s.sensor.per_N[k]);
    }
    return {.change_N = s.sensor.largest_N(change), .gain = gain};
}

const EffectEntry entry{.name = "tilt",
                        .title = "tilted electrode",
                        .equation = "C -> C 2 (1 - (1 - k^2)^(1/2)) / k^2, k = radius * tilt / gap",
                        .source = "derived",
                        .stage = Stage::transducer,
                        .instructions = 240,
                        .models = kCapacitive,
                        .parameters = {{"mounted_rad", "tilt at rest", 0.01, 0, 0.2}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
