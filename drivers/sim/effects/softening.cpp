// Softening (Mullins): below the largest load so far an elastomer yields more than at its first loading.
#include <array>
#include <cmath>

#include "drivers/sim/effects/axes.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> on_axes(const Setting& s, const Axes& axes) {
    return each_drive(axes, [amount = s.p[0], largest = Load{}](double u, std::size_t axis) mutable {
        largest[axis] = std::max(largest[axis], std::abs(u));
        return largest[axis] > 0 ? u * (1 + amount * (1 - std::abs(u) / largest[axis])) : u;
    });
}

// |u| (1 - |u| / m) is at most m / 4, and m - |u|. Its slope is at most 1 by u and at most 1 by m.
Load largest_change(const Setting& s) {
    Load change{};
    for (std::size_t axis = 0; axis < kAxes; ++axis)
        change[axis] = s.p[0] * std::min(max(s, Axis(axis)) / 4, comes_back(s, Axis(axis)));
    return change;
}

Bound bound(const Setting& s) { return bound_of_load(s, largest_change(s), 1 + 2 * s.p[0]); }

const EffectEntry entry{.name = "softening",
                        .title = "softening by the first cycles",
                        .equation = "y = u (1 + d (1 - |u| / max |u| so far))",
                        .source = "Mullins 1969; Ogden, Roxburgh 1999, linear in the load",
                        .stage = Stage::material,
                        .instructions = 90,
                        .models = kHair | kCapacitive,
                        .parameters = {{"amount", "d, of the load", 0.05, 0, 1}},
                        .bound = bound,
                        .make = [](const Setting& s) { return on_axes(s, {}); },
                        .levels = [](const Setting& s) { return fewer_axes(s, largest_change(s), on_axes); }};

}  // namespace
}  // namespace tactiled::sim
