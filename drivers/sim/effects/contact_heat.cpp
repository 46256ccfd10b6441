// Heat of contact: a warm or cold body changes the skin's temperature, which its gauges read as a load.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/warmth.hpp"

namespace tactiled::sim {
namespace {

// The heat goes through the cap, beside which a dummy lies.
Channels warmed_per_K(const Setting& s) {
    return per_channel(s, [&](std::size_t k) { return s.sensor.is_dummy(k) ? 0 : drift_per_K(s, s.p[1], s.p[2], k); });
}

// The slowest mode of diffusion to the depth of the gauges: T' = (share * touch * (body - ambient) - T) / tau.
std::unique_ptr<Effect> make(const Setting& s) {
    const Channels per_K = warmed_per_K(s);
    return each_sample([channels = s.sensor.n(), share = s.p[0],
                        approach = -std::expm1(-1 / (s.rate_Hz * diffusion_s(s.sensor))), scale_N = touch_scale_N(s.sensor),
                        per_K, warmer_K = 0.0](Block& block, std::size_t n) mutable {
        const double surface_K = share * touch(-block.load[kFz][n], scale_N) * (block.body_K[n] - block.ambient_K[n]);
        warmer_K += approach * (surface_K - warmer_K);
        for (std::size_t k = 0; k < channels; ++k) block.channel[k][n] += per_K[k] * warmer_K;
    });
}

// T is at most the largest temperature of the surface times 1 - exp(-length / tau). The load changes it through
// touch, whose slope is at most 1 / scale.
Bound bound(const Setting& s) {
    const double reached = -std::expm1(-(double(s.samples) + 1) / (s.rate_Hz * diffusion_s(s.sensor)));
    const double body_K = s.p[0] * s.extent.body_K * reached, scale_N = touch_scale_N(s.sensor);
    Channels per_touch = warmed_per_K(s);
    for (double& change : per_touch) change *= body_K;
    const double whole = s.sensor.largest_N(per_touch);
    const double change_N = whole * touch(max(s, kFz), scale_N);
    return {.change_N = change_N, .gain = 1 + whole / scale_N * load_of_error(s.sensor, kFz), .own_N = change_N};
}

const EffectEntry entry{
    .name = "contact_heat",
    .title = "heat of contact",
    .equation = "r = r + alpha_k T, T' = (share N / (N + N0) (body - ambient) - T) / tau, tau = L^2 / (pi^2 a)",
    .source = "Fourier's slowest mode, derived: 0.92 s for 1 mm, 8.3 s for 3 mm",
    .stage = Stage::transducer,
    .instructions = 100,
    .parameters = {{"share", "of the body's temperature that reaches the surface in full contact", 0.5, 0, 1},
                   {"per_K", "of R0 or C0; by default by the sensor's model", kByModel, -0.1, 0.1},
                   {"mismatch", "standard deviation between channels, relative", 0.01, 0, 1}},
    .bound = bound,
    .make = make};

}  // namespace
}  // namespace tactiled::sim
