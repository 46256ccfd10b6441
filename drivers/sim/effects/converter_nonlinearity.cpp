// Integral nonlinearity of a converter: its characteristic is curved.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

constexpr double kToOne = 2.598076211353316;  // 27^(1/2) / 2: u (1 - u^2) is largest at u = 3^(-1/2)

// r + INL * range * c (u - u^3), u = (r - zero) / range: 0 at both ends and in the middle.
std::unique_ptr<Effect> make(const Setting& s) {
    const Channels range = per_channel(s, [&](std::size_t k) { return half_range(s.sensor, k); });
    const Channels per_range = per_channel(s, [&](std::size_t k) { return range[k] > 0 ? 1 / range[k] : 0; });
    const Channels amount = per_channel(s, [&](std::size_t k) { return s.p[0] * kToOne * range[k]; });
    return each_reading(s, [zero = s.sensor.zero, per_range, amount](double r, std::size_t k) {
        const double u = std::clamp((r - zero[k]) * per_range[k], -1.0, 1.0);
        return r + amount[k] * u * (1 - u * u);
    });
}

// The slope is between 1 - 2 c INL and 1 + c INL.
Bound bound(const Setting& s) {
    Channels change = largest_swing(s);
    for (std::size_t k = 0; k < s.sensor.n(); ++k) {
        const double inl = std::abs(s.p[0]) * half_range(s.sensor, k);
        change[k] = std::min(std::abs(s.p[0]) * kToOne * change[k], inl);
    }
    return {.change_N = s.sensor.largest_N(change), .gain = 1 + 2 * kToOne * std::abs(s.p[0])};
}

const EffectEntry entry{.name = "converter_nonlinearity",
                        .title = "nonlinearity of the converter",
                        .equation = "r = r + INL range 2.598 (u - u^3), u = (r - zero) / range",
                        .source = "derived; data sheets of 12 bit converters: 1 to 2 steps of 4096",
                        .stage = Stage::converter,
                        .instructions = 180,
                        .parameters = {{"inl", "largest error, of the range", 4e-4, -0.1, 0.1}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
