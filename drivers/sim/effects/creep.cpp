// Creep: under a constant load an elastomer continues to yield, and it recovers as slowly.
#include <array>
#include <cmath>

#include "drivers/sim/effects/axes.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

constexpr std::size_t kTimes = 2;

// A Kelvin chain on each axis: y = u + sum of g_i x_i, x_i' = (u - x_i) / tau_i, exact for a load that is straight between
// samples.
std::unique_ptr<Effect> on_axes(const Setting& s, const Axes& axes) {
    const std::array<double, kTimes> tau{s.p[1], 10 * s.p[1]};
    std::array<double, kTimes> keep{}, now{}, before{};
    for (std::size_t i = 0; i < kTimes; ++i) {
        const double h = 1 / s.rate_Hz / tau[i];
        keep[i] = std::exp(-h);
        now[i] = 1 + std::expm1(-h) / h;  // weight of the newest load
        before[i] = -std::expm1(-h) - now[i];
    }
    return each_drive(axes, [amount = s.p[0] / 2, keep, now, before, last = Load{}, x = std::array<Load, kTimes>{}](
                                double u, std::size_t axis) mutable {
        double y = u;
        for (std::size_t i = 0; i < kTimes; ++i) {
            x[i][axis] = keep[i] * x[i][axis] + before[i] * last[axis] + now[i] * u;
            y += amount * x[i][axis];
        }
        last[axis] = u;
        return y;
    });
}

// |x_i| after T is at most the largest load times 1 - exp(-T / tau_i). T is the length of the scene, which may
// continue after its motions.
Load largest_change(const Setting& s) {
    const double amount = s.p[0] / 2, T = double(s.samples) / s.rate_Hz;
    const double part = amount * (-std::expm1(-T / s.p[1]) - std::expm1(-T / (10 * s.p[1])));
    Load change{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) change[axis] = part * max(s, Axis(axis));
    return change;
}

Bound bound(const Setting& s) { return bound_of_load(s, largest_change(s), 1 + s.p[0]); }

const EffectEntry entry{.name = "creep",
                        .title = "creep and relaxation",
                        .equation = "y = u + sum g_i x_i, x_i' = (u - x_i) / tau_i",
                        .source = "Kelvin chain; load cells creep by 0.2 to 0.8 % in 200 to 400 s, elastomers by 1 to 10 %",
                        .stage = Stage::material,
                        .instructions = 160,
                        .models = kAll | kTaxel,
                        .parameters = {{"amount", "of the load, after a long time", 0.02, 0, 1},
                                       {"time_s", "of the faster half; the slower takes ten times as long", 5, 1e-3, 1e6}},
                        .bound = bound,
                        .make = [](const Setting& s) { return on_axes(s, {}); },
                        .levels = [](const Setting& s) { return fewer_axes(s, largest_change(s), on_axes); }};

}  // namespace
}  // namespace tactiled::sim
