// A quantity that starts with the scene and approaches its end value p[0] exponentially with the time constant p[1]:
// moisture, self-heating.
#pragma once
#include <array>
#include <cmath>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

// x' = (p[0] - x) / p[1], exact. `per_unit`: change of each channel per unit of the quantity.
inline std::unique_ptr<Effect> approach(const Setting& s, const Channels& per_unit) {
    return each_sample([channels = s.sensor.n(), end = s.p[0], step = -std::expm1(-1 / (s.rate_Hz * s.p[1])), per_unit,
                        now = 0.0](Block& block, std::size_t n) mutable {
        for (std::size_t k = 0; k < channels; ++k) block.channel[k][n] += per_unit[k] * now;
        now += step * (end - now);
    });
}

// The bound is exact: the value at the last sample; the rate is highest at the beginning.
inline Bound approach_bound(const Setting& s, Channels per_unit) {
    const double reached = -std::expm1(-(double(s.samples) + 1) / (s.rate_Hz * s.p[1]));
    for (double& change : per_unit) change *= std::abs(s.p[0]) * reached;
    const double change_N = s.sensor.largest_N(per_unit);
    return {.change_N = change_N, .own_N = change_N, .own_rate_N_s = change_N / reached / s.p[1]};
}

}  // namespace tactiled::sim
