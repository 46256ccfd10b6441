// Drift of the bridge's excitation during warm-up and with the ambient temperature; a ratiometric converter has none.
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    return each_sample([channels = s.sensor.n(), amount = s.p[0], per_sample = 1 / (s.p[1] * s.rate_Hz), ppm_K = s.p[2]](
                           Block& block, std::size_t n) {
        const double warm = -std::expm1(-per_sample * double(block.first + n));
        const double gain = 1 + amount * warm + ppm_K * 1e-6 * block.ambient_K[n];
        for (std::size_t k = 0; k < channels; ++k) block.channel[k][n] *= gain;
    });
}

Bound bound(const Setting& s) {
    const double length_s = double(s.samples) / s.rate_Hz;
    const double drift = std::abs(s.p[0]) * -std::expm1(-length_s / s.p[1]) + std::abs(s.p[2]) * 1e-6 * s.extent.ambient_K;
    const double relative_1_s =
        std::abs(s.p[0]) / s.p[1] + (s.extent.ambient_K > 0 ? std::abs(s.p[2]) * 1e-6 * s.extent.ambient_rate_K_s : 0);
    Channels change = largest_swing(s);
    for (std::size_t k = 0; k < s.sensor.n(); ++k) change[k] = drift * (change[k] + std::abs(s.sensor.zero[k]));
    const double change_N = s.sensor.largest_N(change);
    return {.change_N = change_N,
            .gain = 1 + drift,
            .own_N = change_N,
            .own_rate_N_s = drift > 0 ? change_N / drift * relative_1_s : 0};
}

const EffectEntry entry{.name = "excitation_drift",
                        .title = "drift of the excitation",
                        .equation = "r = r (1 + d (1 - exp(-t / tau)) + c dT)",
                        .source = "derived; references drift by 10 to 50 ppm a K",
                        .stage = Stage::converter,
                        .instructions = 140,
                        .models = kTable | kHair,
                        .parameters = {{"amount", "once it is warm", 3e-4, -0.5, 0.5},
                                       {"time_s", "of warming up", 300, 1e-3, 1e6},
                                       {"ppm_K", "with the surroundings", 25, -1e4, 1e4}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
