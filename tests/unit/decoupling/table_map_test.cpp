// Method "map" against finite elements. The readings come from the same table as the solver's map, but between its nodes by
// another interpolation (four-point Lagrange along rings and radii, not a spline), or from nodes that the map does not have.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <random>

#include "decoupling/influence_map.hpp"
#include "fem_table.hpp"

namespace tactiled {
namespace {

constexpr int kRings = 20, kAngles = 48;
constexpr double kSpacing_m = 46.5e-6;

const std::vector<std::vector<double>>& influence() {
    static const auto rows = fem_influence();
    return rows;
}

// Row of (ring, angle) in the file: the centre, then ring by ring.
std::size_t node(int ring, int angle) {
    if (ring < 0) return node(-ring, angle + kAngles / 2);
    return ring == 0 ? 0 : std::size_t(1 + (ring - 1) * kAngles + (angle % kAngles + kAngles) % kAngles);
}

std::array<double, 4> lagrange(double t) {  // nodes -1 0 1 2
    return {-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2, -(t + 1) * t * (t - 2) / 2, (t + 1) * t * (t - 1) / 6};
}

struct Contact {
    double x_m, y_m;
    std::array<double, 3> force_N;
};

// What R1 .. R8 strain.
std::vector<double> strains(const Contact& contact) {
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

Contact random_contact(std::mt19937_64& random, double most_m, double press_N = 1, double shear_N = 0.5) {
    std::uniform_real_distribution<double> unit(0, 1);
    const double r = most_m * std::sqrt(unit(random)), angle = 2 * std::numbers::pi * unit(random);
    const double t = shear_N * unit(random), towards = 2 * std::numbers::pi * unit(random);
    return {r * std::cos(angle), r * std::sin(angle), {t * std::cos(towards), t * std::sin(towards), -press_N}};
}

double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v * v;
    return std::sqrt(sum / double(values.size()));
}

struct Error {
    double point_m, force, normal;  // force: of the vector's length
};
Error error_of(const Estimate& estimate, const Contact& truth) {
    const auto& w = estimate.wrench_S;
    const auto& f = truth.force_N;
    return {std::hypot(-w[4] / w[2] - truth.x_m, w[3] / w[2] - truth.y_m),
            std::hypot(w[0] - f[0], w[1] - f[1], w[2] - f[2]) / std::hypot(f[0], f[1], f[2]), std::abs(w[2] / f[2] - 1)};
}

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

enum class Noise { kNone, kOfTheMean, kOfEach };

std::vector<double> noisy(std::vector<double> reading, Noise noise, std::mt19937_64& random) {
    std::normal_distribution<double> one(0, 0.01);
    const double mean = rms(reading);
    if (noise != Noise::kNone)
        for (auto& r : reading) r += one(random) * (noise == Noise::kOfTheMean ? mean : r);
    return reading;
}

// Method "linear" of the same sensor, from the finite elements of a uniform load.
Calibration linear_calibration() {
    Calibration calibration = table_calibration(all_gauges());
    calibration.parameters = {
        {"normal_inner", 422.2e-6}, {"tangential_inner", 724.0e-6}, {"tangential_outer", 572.8e-6}, {"noise", 1e-6}};
    return calibration;
}

TEST(TableMap, FindsPointAndForceAnywhereBetweenTheNodes) {
    const auto map = make_decoupler(map_calibration());
    const auto linear = make_decoupler(linear_calibration());
    for (const Noise noise : {Noise::kNone, Noise::kOfTheMean, Noise::kOfEach}) {
        std::mt19937_64 random(1);
        std::vector<double> points, forces, normals, linear_forces;
        int wrong_sign = 0, good = 0;
        const int samples = 4000;
        for (int i = 0; i < samples; ++i) {
            const Contact truth = random_contact(random, 0.9e-3);
            const auto reading = noisy(strains(truth), noise, random);
            (void)map->decouple({.channel = {}});  // another device: forgets the last point
            const Estimate estimate = decouple(*map, reading);
            const Error error = error_of(estimate, truth);
            points.push_back(error.point_m);
            forces.push_back(error.force);
            normals.push_back(error.normal);
            good += estimate.quality == TACTILED_GOOD ? 1 : 0;
            const Estimate straight = decouple(*linear, reading);
            linear_forces.push_back(error_of(straight, truth).force);
            wrong_sign += straight.wrench_S[2] > 0 ? 1 : 0;
        }
        std::printf("noise %s, 1 N press and up to 0.5 N shear anywhere within 0.9 mm:\n",
                    noise == Noise::kNone        ? "none"
                    : noise == Noise::kOfTheMean ? "1 % of the gauges' rms"
                                                 : "1 % of each gauge's reading");
        Percentiles(points).print("map: point", 1e6, "um");
        Percentiles(forces).print("map: force vector", 100, "%");
        Percentiles(normals).print("map: normal force", 100, "%");
        Percentiles(linear_forces).print("linear: force vector", 100, "%");
        std::printf("  map: %.1f %% GOOD; linear: %.1f %% of the presses read as a pull\n", 100.0 * good / samples,
                    100.0 * wrong_sign / samples);
    }
}

TEST(TableMap, CostsFewMicrosecondsWarm) {
    const auto map = make_decoupler(map_calibration());
    std::mt19937_64 random(3);
    std::vector<std::vector<double>> readings;
    for (int i = 0; i < 5000; ++i) {  // a finger that circles: 0.5 mm, one turn in 500 samples
        const double angle = 2 * std::numbers::pi * i / 500;
        readings.push_back(noisy(strains({0.5e-3 * std::cos(angle), 0.5e-3 * std::sin(angle), {0.2, 0.1, -1}}),
                                 Noise::kOfTheMean, random));
    }
    double best_us = 1e9, worst_us = 0;
    for (int trial = 0; trial < 20; ++trial) {
        const auto begun = std::chrono::steady_clock::now();
        for (const auto& reading : readings) (void)decouple(*map, reading);
        best_us = std::min(best_us, std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begun).count() /
                                        double(readings.size()));
    }
    for (const auto& reading : readings) {
        (void)map->decouple({.channel = {}});
        const auto begun = std::chrono::steady_clock::now();
        (void)decouple(*map, reading);
        worst_us = std::max(worst_us, std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begun).count());
    }
    std::printf("map: %.2f us a sample, warm (mean, best of 20 runs); a search anew: at most %.1f us\n", best_us, worst_us);
}

}  // namespace
}  // namespace tactiled
