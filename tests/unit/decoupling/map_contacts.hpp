// Contacts on the table sensor in S, and the readings of its gauges. The readings come from the same table as the
// solver's map, but with another interpolation between its nodes (four-point Lagrange along rings and radii, not a
// spline), or from nodes that the map does not have.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>
#include <vector>

#include "fem_table.hpp"

namespace tactiled {

// The file's grid: the centre and kRings rings of kAngles points.
inline constexpr int kRings = 20, kAngles = 48;
inline constexpr double kSpacing_m = 46.5e-6;

// fem_influence(), read once: x_m y_m, strain per N.
inline const std::vector<std::vector<double>>& influence() {
    static const auto rows = fem_influence();
    return rows;
}

// Row of (ring, angle) in the file: the centre, then ring by ring.
inline std::size_t node(int ring, int angle) {
    if (ring < 0) return node(-ring, angle + kAngles / 2);
    return ring == 0 ? 0 : std::size_t(1 + (ring - 1) * kAngles + (angle % kAngles + kAngles) % kAngles);
}

// Returns the weights of the values at -1 0 1 2 for t, 0 .. 1.
inline std::array<double, 4> lagrange(double t) {
    return {-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2, -(t + 1) * t * (t - 2) / 2,
            (t + 1) * t * (t - 1) / 6};
}

struct Contact {
    double x_m, y_m;
    std::array<double, 3> force_N;
};

// Returns the strains of R1 .. R8.
inline std::vector<double> strains(const Contact& contact) {
    const double r = std::hypot(contact.x_m, contact.y_m) / kSpacing_m;
    double turn = std::atan2(contact.y_m, contact.x_m) / (2 * std::numbers::pi) * kAngles;
    if (turn < 0) turn += kAngles;
    const int ring = std::clamp(int(r), 0, kRings - 2), sector = int(turn);
    const auto wr = lagrange(r - ring), wa = lagrange(turn - sector);
    std::vector<double> result(8, 0.0);
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) {
            const auto& row = influence()[node(ring + i - 1, sector + j - 1)];
            const double w = wr[std::size_t(i)] * wa[std::size_t(j)];
            for (std::size_t k = 0; k < 8; ++k)
                for (std::size_t c = 0; c < 3; ++c) result[k] += w * row[2 + 3 * k + c] * contact.force_N[c];
        }
    return result;
}

// Returns a contact anywhere within max_m of the middle, with up to shear_N in any direction.
inline Contact random_contact(std::mt19937_64& random, double max_m, double press_N = 1, double shear_N = 0.5) {
    std::uniform_real_distribution<double> unit(0, 1);
    const double r = max_m * std::sqrt(unit(random)), angle = 2 * std::numbers::pi * unit(random);
    const double t = shear_N * unit(random), towards = 2 * std::numbers::pi * unit(random);
    return {r * std::cos(angle), r * std::sin(angle), {t * std::cos(towards), t * std::sin(towards), -press_N}};
}

inline double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v * v;
    return std::sqrt(sum / double(values.size()));
}

struct Error {
    double point_m, force, normal;  // force: magnitude of the vector
};
inline Error error_of(const Estimate& estimate, const Contact& truth) {
    const auto& w = estimate.wrench_S;
    const auto& f = truth.force_N;
    return {std::hypot(-w[4] / w[2] - truth.x_m, w[3] / w[2] - truth.y_m),
            std::hypot(w[0] - f[0], w[1] - f[1], w[2] - f[2]) / std::hypot(f[0], f[1], f[2]), std::abs(w[2] / f[2] - 1)};
}

// Percentiles of at least one value.
struct Percentiles {
    double p50, p90, p95, p99;
    explicit Percentiles(std::vector<double> v) {
        std::sort(v.begin(), v.end());
        const auto at = [&](double share) { return v[std::size_t(share * double(v.size() - 1))]; };
        p50 = at(0.5), p90 = at(0.9), p95 = at(0.95), p99 = at(0.99);
    }
    void print(const char* what, double scale, const char* unit) const {
        std::printf("  %-34s 50 %% %8.3g   90 %% %8.3g   95 %% %8.3g   99 %% %8.3g %s\n", what, p50 * scale, p90 * scale,
                    p95 * scale, p99 * scale, unit);
    }
};

// In %.
inline double share_below(const std::vector<double>& values, double limit) {
    return 100.0 * double(std::count_if(values.begin(), values.end(), [&](double v) { return v < limit; })) /
           double(values.size());
}

enum class Noise { kNone, kOfTheMean, kOfEach };  // noise of 1 %: of the gauges' rms, or of each gauge's reading

inline std::vector<double> noisy(std::vector<double> reading, Noise noise, std::mt19937_64& random) {
    std::normal_distribution<double> one(0, 0.01);
    const double mean = rms(reading);
    if (noise != Noise::kNone)
        for (auto& r : reading) r += one(random) * (noise == Noise::kOfTheMean ? mean : r);
    return reading;
}

}  // namespace tactiled
