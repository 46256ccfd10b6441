// The axes on which an effect of the material works: all, or at a cheaper level those that carry load.
#pragma once
#include <algorithm>
#include <array>
#include <numeric>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

struct Axes {
    std::array<std::size_t, kAxes> at{kFx, kFy, kFz, kMx, kMy};
    std::size_t n = kAxes;
};

inline constexpr Axes kPress{{kFz}, 1};

// Replaces the drive u of each axis, axis after axis, by f(u, axis).
template <class F>
std::unique_ptr<Effect> each_drive(const Axes& axes, F f) {
    return each_block([axes, f = std::move(f)](Block& block) mutable {
        for (std::size_t i = 0; i < axes.n; ++i)
            for (std::size_t n = 0; n < block.n; ++n) {
                double& u = block.drive[axes.at[i]][n];
                u = f(u, axes.at[i]);
            }
    });
}

// Returns the levels of an effect make(setting, axes) that treats each axis independently and changes it by at most
// `change` (N, Nm): with the four, three, two or one axes on which the change is largest. setup
inline std::vector<Level> fewer_axes(const Setting& s, const Load& change,
                                     std::unique_ptr<Effect> (*make)(const Setting&, const Axes&)) {
    static constexpr std::array<std::string_view, kAxes - 1> kName{"1_axis", "2_axes", "3_axes", "4_axes"};
    Load makes_N{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
        Load alone{};
        alone[axis] = change[axis];
        makes_N[axis] = s.sensor.channel_N(alone);
    }
    Axes axes;
    std::stable_sort(axes.at.begin(), axes.at.end(), [&](std::size_t a, std::size_t b) { return makes_N[a] > makes_N[b]; });
    std::vector<Level> levels;
    Load omitted = change;
    for (axes.n = 1; axes.n < kAxes; ++axes.n) {
        omitted[axes.at[axes.n - 1]] = 0;
        levels.push_back(
            {kName[axes.n - 1], s.sensor.channel_N(omitted), [axes, make](const Setting& in) { return make(in, axes); }});
    }
    return levels;
}

}  // namespace tactiled::sim
