// Misalignment: the sensing element is rotated in its mount, so that it measures the load in a rotated frame.
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

using Rotation = std::array<std::array<double, 3>, 3>;

// Matrix that expresses a vector in a frame rotated about x, then y, then z: the transpose of Rz Ry Rx.
Rotation rotation(const Setting& s) {
    constexpr double kDegree = 3.141592653589793 / 180;
    const double cx = std::cos(s.p[0] * kDegree), sx = std::sin(s.p[0] * kDegree);
    const double cy = std::cos(s.p[1] * kDegree), sy = std::sin(s.p[1] * kDegree);
    const double cz = std::cos(s.p[2] * kDegree), sz = std::sin(s.p[2] * kDegree);
    return {{{cz * cy, sz * cy, -sy},
             {cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx},
             {cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx}}};
}

// The moment about z, which no sensor here measures, counts as 0.
std::unique_ptr<Effect> make(const Setting& s) {
    return each_sample([r = rotation(s)](Block& block, std::size_t n) {
        auto& [fx, fy, fz, mx, my] = block.load;
        const double x = fx[n], y = fy[n], z = fz[n], about_x = mx[n], about_y = my[n];
        fx[n] = r[0][0] * x + r[0][1] * y + r[0][2] * z;
        fy[n] = r[1][0] * x + r[1][1] * y + r[1][2] * z;
        fz[n] = r[2][0] * x + r[2][1] * y + r[2][2] * z;
        mx[n] = r[0][0] * about_x + r[0][1] * about_y;
        my[n] = r[1][0] * about_x + r[1][1] * about_y;
    });
}

// |R - 1| times the largest of each component.
Load change(const Setting& s, const Load& max) {
    const Rotation r = rotation(s);
    Load result{};
    for (std::size_t row = 0; row < 3; ++row)
        for (std::size_t column = 0; column < 3; ++column) {
            const double part = std::abs(r[row][column] - (row == column ? 1 : 0));
            result[row] += part * max[column];
            if (row < 2 && column < 2) result[kMx + row] += part * max[kMx + column];
        }
    return result;
}

Bound bound(const Setting& s) {
    const Load error = observed(s.sensor);
    const Load turned = change(s, s.extent.max);
    const Rotation r = rotation(s);
    double across = 0;
    for (std::size_t row = 0; row < 3; ++row)
        for (std::size_t column = 0; column < 3; ++column)
            if (row != column) across = std::max(across, std::abs(r[row][column]));
    return {.change_N = s.sensor.channel_N(turned),
            .gain = 1 + s.sensor.channel_N(change(s, error)),
            .load = turned,
            .coupling = across};
}

const EffectEntry entry{.name = "misalignment",
                        .title = "misalignment of the mount",
                        .equation = "F = R^T F, M = R^T M, R = Rz Ry Rx",
                        .source = "derived",
                        .stage = Stage::contact,
                        .instructions = 40,
                        .parameters = {{"about_x_deg", "rotation of the sensing element", 0.5, -180, 180},
                                       {"about_y_deg", "rotation of the sensing element", -0.3, -180, 180},
                                       {"about_z_deg", "rotation of the sensing element", 1, -180, 180}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
