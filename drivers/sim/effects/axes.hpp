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

// Returns the levels of an effect E(setting, axes) that treats each axis independently and changes it by at most
// `change` (N, Nm): with the four, three, two or one axes on which the change is largest. setup
template <class E>
std::vector<Level> fewer_axes(const Setting& s, const std::array<double, kAxes>& change) {
    static constexpr std::array<std::string_view, kAxes - 1> kName{"1_axis", "2_axes", "3_axes", "4_axes"};
    std::array<double, kAxes> makes_N{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
        std::array<double, kAxes> alone{};
        alone[axis] = change[axis];
        makes_N[axis] = s.sensor.channel_N(alone);
    }
    Axes axes;
    std::stable_sort(axes.at.begin(), axes.at.end(), [&](std::size_t a, std::size_t b) { return makes_N[a] > makes_N[b]; });
    std::vector<Level> levels;
    std::array<double, kAxes> omitted = change;
    for (axes.n = 1; axes.n < kAxes; ++axes.n) {
        omitted[axes.at[axes.n - 1]] = 0;
        levels.push_back({kName[axes.n - 1], s.sensor.channel_N(omitted),
                          [axes](const Setting& in) { return std::make_unique<E>(in, axes); }});
    }
    return levels;
}

}  // namespace tactiled::sim
