// An array that is pressed: contacts whose force, place, area and direction are known exactly, as integrals over the area of
// each taxel. It shares no code with the model.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "drivers/taxels.hpp"

namespace tactiled::pressed {

enum class Kind { ball, punch, edge, none };

// A body at (x, y), m, of force N along -z, its long side turned by `turn` rad from x. `length` and `width` are the half
// axes of its contact, m: of an ellipse with the pressure of Hertz, or of a rectangle with an even one.
struct Body {
    Kind kind = Kind::none;
    double x = 0, y = 0, force = 0, length = 0, width = 0, turn = 0;
    double shear_x = 0, shear_y = 0;  // N, spread as the press is

    [[nodiscard]] double area_m2() const {
        return kind == Kind::ball ? std::numbers::pi * length * width : 4 * length * width;
    }
    // Pressure relative to its mean over the contact.
    [[nodiscard]] double pressure(double at_x, double at_y) const {
        const double dx = at_x - x, dy = at_y - y;
        const double u = (std::cos(turn) * dx + std::sin(turn) * dy) / length,
                     v = (-std::sin(turn) * dx + std::cos(turn) * dy) / width;
        if (kind == Kind::ball) return u * u + v * v < 1 ? 1.5 * std::sqrt(1 - u * u - v * v) : 0;
        return std::abs(u) < 1 && std::abs(v) < 1 ? 1 : 0;
    }
};

struct Array {
    std::size_t rows = 16, columns = 16, values = 1;  // values: 1 = z, 3 = x y z
    double pitch_m = 2e-3;
    double noise_N = 0.005, gain_sd = 0.02;
    double counts_per_N = 1000;
    double narrowest_mm = 0;    // contact, as the calibration states it
    unsigned frozen_after = 0;  // frames

    [[nodiscard]] std::size_t taxels() const { return rows * columns; }
    [[nodiscard]] double x(std::size_t i) const { return (double(i % columns) - double(columns - 1) / 2) * pitch_m; }
    [[nodiscard]] double y(std::size_t i) const { return (double(rows - 1) / 2 - double(i / columns)) * pitch_m; }
};

// The calibration that a maker would state for it.
inline Calibration calibration_of(const Array& array) {
    Calibration c;
    c.path = "array";
    c.model = "patch";
    c.method = "linear";
    c.channel_unit = "counts";
    const double per_count = -1 / array.counts_per_N;  // a press counts up
    if (array.values == 1) {
        c.channels = {"Z"};
        c.components = {"fz", "mx", "my"};
        c.tables["taxel"] = {{per_count}};
        c.tables["taxel_sd"] = {{array.noise_N}};
    } else {
        c.channels = {"X", "Y", "Z"};
        c.components = {"fx", "fy", "fz", "mx", "my", "mz"};
        c.tables["taxel"] = {{-per_count, 0, 0}, {0, -per_count, 0}, {0, 0, per_count}};
        c.tables["taxel_sd"] = {{array.noise_N, array.noise_N, array.noise_N}};
    }
    c.zero.assign(c.channels.size(), 0);
    c.parameters = {{"rows", double(array.rows)},
                    {"columns", double(array.columns)},
                    {"pitch_mm", array.pitch_m * 1e3},
                    {"gain_sd", array.gain_sd},
                    {"narrowest_contact_mm", array.narrowest_mm},
                    {"frozen_after", double(array.frozen_after)}};
    return c;
}

// The parts of a body's force on each taxel, with `kParts` by `kParts` points in each.
inline std::vector<double> parts_of(const Array& array, const Body& body) {
    constexpr int kParts = 12;
    std::vector<double> part(array.taxels(), 0);
    double sum = 0;
    const double reach = std::max(body.length, body.width) * 1.5 + array.pitch_m;
    for (std::size_t i = 0; i < array.taxels() && body.kind != Kind::none; ++i) {
        if (std::abs(array.x(i) - body.x) > reach || std::abs(array.y(i) - body.y) > reach) continue;
        for (int a = 0; a < kParts; ++a)
            for (int b = 0; b < kParts; ++b)
                part[i] += body.pressure(array.x(i) + ((a + 0.5) / kParts - 0.5) * array.pitch_m,
                                         array.y(i) + ((b + 0.5) / kParts - 0.5) * array.pitch_m);
        sum += part[i];
    }
    for (double& p : part) p /= sum > 0 ? sum : 1;
    return part;
}

// Adds the readings of a body to `raw`, which has the layout of Taxels. `gain`: of each taxel.
inline void press(const Array& array, const Body& body, const std::vector<double>& gain, std::vector<float>& raw) {
    const std::size_t n = array.taxels();
    const std::vector<double> part = parts_of(array, body);
    const double force[3]{body.shear_x, body.shear_y, body.force};
    for (std::size_t v = 0; v < array.values; ++v)
        for (std::size_t i = 0; i < n; ++i)
            raw[v * n + i] += float(part[i] * gain[i] * force[array.values == 1 ? 2 : v] * array.counts_per_N);
}

}  // namespace tactiled::pressed
