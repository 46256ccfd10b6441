// Method "map" against finite elements. The readings come from the same table as the solver's map, but between its nodes by
// another interpolation (four-point Lagrange along rings and radii, not a spline), or from nodes that the map does not have.
#include <gtest/gtest.h>

#include <Eigen/Dense>
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
    return {-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2, -(t + 1) * t * (t - 2) / 2,
            (t + 1) * t * (t - 1) / 6};
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

double share_below(const std::vector<double>& values, double limit) {
    return 100.0 * double(std::count_if(values.begin(), values.end(), [&](double v) { return v < limit; })) /
           double(values.size());
}

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
        std::vector<double> points, forces, normals, linear_forces, good_points, good_forces;
        int wrong_sign = 0, good = 0, within_sd = 0;
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
            if (estimate.quality == TACTILED_GOOD) {
                within_sd += std::abs(estimate.wrench_S[2] - truth.force_N[2]) < estimate.sd[2] ? 1 : 0;
                good_points.push_back(error.point_m);
                good_forces.push_back(error.force);
            }
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
        Percentiles(good_points).print("map, GOOD samples: point", 1e6, "um");
        Percentiles(good_forces).print("map, GOOD samples: force vector", 100, "%");
        Percentiles(linear_forces).print("linear: force vector", 100, "%");
        std::printf(
            "  map: %.1f %% GOOD, of these %.1f %% have fz within one sd; linear: %.1f %% of the presses read as a pull\n",
            100.0 * good / samples, 100.0 * within_sd / good, 100.0 * wrong_sign / samples);
        std::printf("  map: %.1f %% within 50 um, %.1f %% within 3 %% of the force; linear: %.1f %% within 3 %%\n",
                    share_below(points, 50e-6), share_below(forces, 0.03), share_below(linear_forces, 0.03));
        const bool of_the_mean = noise == Noise::kOfTheMean;
        EXPECT_LT(Percentiles(points).p50, of_the_mean ? 8e-6 : 5e-6);    // m
        EXPECT_LT(Percentiles(points).p90, of_the_mean ? 60e-6 : 20e-6);  // m
        EXPECT_LT(Percentiles(forces).p50, of_the_mean ? 0.035 : 0.025);
        EXPECT_GT(Percentiles(linear_forces).p50, 0.5);
        EXPECT_GT(good, 0.78 * samples);
        EXPECT_LT(Percentiles(good_points).p99, 50e-6);  // m
        EXPECT_GT(within_sd, 0.66 * good);
    }
}

// First touches, each searched for over the whole plate: a wrong minimum is not marked GOOD.
TEST(TableMap, NoFirstTouchIsGoodAndFarOff) {
    const auto map = make_decoupler(map_calibration());
    for (const Noise noise : {Noise::kNone, Noise::kOfEach, Noise::kOfTheMean}) {
        std::mt19937_64 random(20260312);
        int good = 0, far = 0;
        const int touches = 6000;
        for (int i = 0; i < touches; ++i) {
            const Contact truth = i % 2 == 0 ? random_contact(random, 0.9e-3) : random_contact(random, 0.6e-3, 0.6, 0.35);
            const auto reading = noisy(strains(truth), noise, random);
            (void)map->decouple({.channel = {}});
            const Estimate estimate = decouple(*map, reading);
            if (estimate.quality != TACTILED_GOOD) continue;
            const auto& f = truth.force_N;
            const std::array<double, 5> right{f[0], f[1], f[2], truth.y_m * f[2], -truth.x_m * f[2]};
            bool is_far = false;
            for (std::size_t c = 0; c < 5; ++c)
                is_far = is_far || !(std::abs(estimate.wrench_S[c] - right[c]) <= 5 * estimate.sd[c]);
            ++good;
            far += is_far ? 1 : 0;
            if (is_far)
                std::printf(
                    "  at (%.0f, %.0f) um, force (%.2f, %.2f, %.2f) N: (%.0f, %.0f) um, (%.2f, %.2f, %.2f) N, sd of fz "
                    "%.3f\n",
                    1e6 * truth.x_m, 1e6 * truth.y_m, f[0], f[1], f[2], 1e6 * estimate.cop_S_m[0], 1e6 * estimate.cop_S_m[1],
                    estimate.wrench_S[0], estimate.wrench_S[1], estimate.wrench_S[2], estimate.sd[2]);
        }
        std::printf("  first touches, noise %s: %d of %d GOOD, %d of them farther off than 5 sd\n",
                    noise == Noise::kNone     ? "none"
                    : noise == Noise::kOfEach ? "1 % of each reading"
                                              : "1 % of the rms",
                    good, touches, far);
        EXPECT_GT(good, 0.8 * touches);
        // Noise in all readings as large as the gain error that is allowed for: where the force bends within a few sd.
        EXPECT_LE(far, noise == Noise::kOfTheMean ? 3 : 0);
    }
}

// Noise: each reading by itself off by 1 % of its value, normally distributed, and 1e-6 of strain. The bound is Cramer and
// Rao's: no estimator of five unknowns that is right on average has a smaller covariance than (J' W J)^-1.
TEST(TableMap, TheForceIsAsGoodAsTheNoiseAllows) {
    std::string fault;
    const auto influence_map = influence_of(map_calibration(), fault);
    ASSERT_TRUE(influence_map) << fault;
    const auto map = make_decoupler(map_calibration());
    std::mt19937_64 random(9);
    std::normal_distribution<double> one(0, 1);
    std::vector<double> bounds, ratios;
    std::array<std::vector<double>, 6> bounds_of_ring, errors_of_ring;  // 0.15 mm wide each
    double errors2 = 0, bounds2 = 0;
    int beyond = 0, within = 0, at_the_bound = 0, good = 0;
    const int samples = 4000;
    for (int i = 0; i < samples; ++i) {
        const Contact truth = random_contact(random, 0.9e-3);
        const auto clean = strains(truth);
        const Eigen::Vector3d force(truth.force_N[0], truth.force_N[1], truth.force_N[2]);
        InfluenceMap::At at;
        influence_map->at(truth.x_m, truth.y_m, at);
        Eigen::Matrix<double, 8, 5> j;  // per N, and per 0.1 mm
        j << at.value, 1e-4 * at.dx * force, 1e-4 * at.dy * force;
        auto reading = clean;
        for (int k = 0; k < 8; ++k) {
            const double sd = std::hypot(1e-6, 0.01 * clean[std::size_t(k)]);
            j.row(k) /= sd;
            reading[std::size_t(k)] += sd * one(random);
        }
        // Of the weighted J: inverse * inverse' is the bound.
        const Eigen::Matrix<double, 5, 8> inverse = j.colPivHouseholderQr().solve(Eigen::Matrix<double, 8, 8>::Identity());
        const double bound = inverse.topRows<3>().norm() / force.norm();
        Eigen::Matrix<double, 8, 1> e;
        for (int k = 0; k < 8; ++k) e[k] = one(random);
        (void)map->decouple({.channel = {}});
        const Estimate estimate = decouple(*map, reading);
        const double error = error_of(estimate, truth).force;
        bounds.push_back(bound);
        const auto ring = std::min<std::size_t>(5, std::size_t(std::hypot(truth.x_m, truth.y_m) / 0.15e-3));
        bounds_of_ring[ring].push_back(bound);
        errors_of_ring[ring].push_back(error);
        beyond += bound > 0.03 ? 1 : 0;
        within += error < 0.03 ? 1 : 0;
        at_the_bound += (inverse.topRows<3>() * e).norm() < 0.03 * force.norm() ? 1 : 0;
        if (estimate.quality != TACTILED_GOOD) continue;
        ++good;
        ratios.push_back(error / bound);
        errors2 += error * error;
        bounds2 += bound * bound;
    }
    const double ratio = rms(ratios);
    std::printf("  bound of the force, rms:  50 %% %.2f   90 %% %.2f %%; above 3 %% at %.1f %% of the contacts\n",
                100 * Percentiles(bounds).p50, 100 * Percentiles(bounds).p90, 100.0 * beyond / samples);
    std::printf(
        "  within 3 %%: %.1f %%, at the bound %.1f %%; GOOD samples (%.1f %%): rms of error / bound %.2f, pooled %.2f\n",
        100.0 * within / samples, 100.0 * at_the_bound / samples, 100.0 * good / samples, ratio,
        std::sqrt(errors2 / bounds2));
    for (std::size_t ring = 0; ring < 6; ++ring)
        std::printf(
            "  %.2f .. %.2f mm from the middle: bound 50 %% %5.2f   90 %% %5.2f %%, at most 3 %% at %4.1f %%; within 3 %%: "
            "%4.1f %%\n",
            0.15 * double(ring), 0.15 * double(ring + 1), 100 * Percentiles(bounds_of_ring[ring]).p50,
            100 * Percentiles(bounds_of_ring[ring]).p90, share_below(bounds_of_ring[ring], 0.03),
            share_below(errors_of_ring[ring], 0.03));
    EXPECT_GT(beyond, 0.3 * samples);
    EXPECT_GT(within, 0.88 * at_the_bound);
    EXPECT_LT(ratio, 1.35);
}

// The map has every second ring and angle only; the readings are those of finite elements at nodes in between.
TEST(TableMap, FindsNodesThatWereLeftOutOfItsMap) {
    Calibration calibration = map_calibration();
    auto& rows = calibration.tables["influence"];
    rows.clear();
    for (int ring = 0; ring <= kRings; ring += 2)
        for (int angle = 0; angle < (ring == 0 ? 1 : kAngles); angle += 2) rows.push_back(influence()[node(ring, angle)]);
    const auto map = make_decoupler(calibration);
    std::vector<double> points, forces;
    for (int ring = 1; ring <= 17; ring += 2)
        for (int angle = 1; angle < kAngles; angle += 2) {
            const auto& row = influence()[node(ring, angle)];
            std::vector<double> reading(8, 0.0);
            const Contact truth{row[0], row[1], {0.2, -0.1, -1}};
            for (std::size_t k = 0; k < 8; ++k)
                for (std::size_t c = 0; c < 3; ++c) reading[k] += row[2 + 3 * k + c] * truth.force_N[c];
            (void)map->decouple({.channel = {}});
            const Error error = error_of(decouple(*map, reading), truth);
            points.push_back(error.point_m);
            forces.push_back(error.force);
        }
    std::printf("a map of a quarter of the nodes, %zu nodes in between:\n", points.size());
    Percentiles(points).print("map: point", 1e6, "um");
    Percentiles(forces).print("map: force vector", 100, "%");
    EXPECT_LT(Percentiles(points).p50, 10e-6);
    EXPECT_LT(Percentiles(forces).p50, 0.03);
}

TEST(TableMap, TheMeanOfTheMapIsTheUniformLoad) {
    Problems problems;
    std::string fault;
    const auto map = influence_of(map_calibration(), fault);
    ASSERT_TRUE(map) << fault;
    const Influence mean = map->mean();
    const auto uniform = fem_compliance();
    for (int k = 0; k < 8; k += 2)
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(mean(k, c), uniform[std::size_t(k)][std::size_t(c)], 0.03 * 724e-6) << k << c;
}

TEST(TableMap, ReturnsTheNodesThemselvesAndTheCentre) {
    std::string fault;
    const auto map = influence_of(map_calibration(), fault);
    ASSERT_TRUE(map) << fault;
    for (const auto& row : influence()) {
        InfluenceMap::At at;
        map->at(row[0], row[1], at);
        for (int k = 0; k < 8; ++k)
            for (int c = 0; c < 3; ++c)
                ASSERT_NEAR(at.value(k, c), row[std::size_t(2 + 3 * k + c)], 2e-7) << row[0] << " " << row[1];
    }
    // Its derivatives are those of its values.
    std::mt19937_64 random(5);
    for (int i = 0; i < 1000; ++i) {
        const Contact p = random_contact(random, 0.92e-3);
        const double h = 1e-8;
        InfluenceMap::At at, right, left, up, down;
        map->at(p.x_m, p.y_m, at);
        map->at(p.x_m + h, p.y_m, right);
        map->at(p.x_m - h, p.y_m, left);
        map->at(p.x_m, p.y_m + h, up);
        map->at(p.x_m, p.y_m - h, down);
        ASSERT_LT((at.dx - (right.value - left.value) / (2 * h)).cwiseAbs().maxCoeff(), 0.05);  // of up to 100 per N and m
        ASSERT_LT((at.dy - (up.value - down.value) / (2 * h)).cwiseAbs().maxCoeff(), 0.05);
    }
}

TEST(TableMap, SolvesWithoutOneGaugeAndSaysSo) {
    const Contact truth{0.2e-3, -0.25e-3, {0.2, 0.1, -1}};
    const auto whole = strains(truth);
    for (std::size_t k = 0; k < 8; ++k) {
        const auto map = make_decoupler(map_calibration());
        const Estimate all = decouple(*map, whole);
        auto reading = whole;
        reading[k] = kNaN;
        const Estimate missing = decouple(*map, reading);
        EXPECT_LT(error_of(missing, truth).point_m, 10e-6) << k;
        EXPECT_LT(error_of(missing, truth).force, 0.05) << k;
        EXPECT_NE(missing.reasons & TACTILED_MISSING_CHANNEL, 0u);
        if (!std::isnan(missing.sd[2])) {
            EXPECT_GT(missing.sd[0] + missing.sd[1] + missing.sd[2], all.sd[0] + all.sd[1] + all.sd[2]);
        }
        reading[k] = 0.5 * whole[k];
        const Estimate saturated = decouple(*map, reading, 0, 1u << k);
        EXPECT_LT(error_of(saturated, truth).force, 0.05) << k;
        EXPECT_NE(saturated.reasons & TACTILED_SATURATED, 0u);
    }
}

TEST(TableMap, FindsADeadGaugeAndGoesOnWithoutIt) {
    const auto map = make_decoupler(map_calibration());
    const Contact truth{0.2e-3, -0.25e-3, {0.2, 0.1, -1}};
    auto reading = strains(truth);
    reading[4] = 0;
    for (int i = 0; i < 3; ++i) {
        const Estimate estimate = decouple(*map, reading);
        EXPECT_EQ(estimate.quality, TACTILED_UNCERTAIN);
        EXPECT_NE(estimate.reasons & TACTILED_DISAGREEMENT, 0u);
        EXPECT_NE(estimate.reasons & TACTILED_MISSING_CHANNEL, 0u);
        EXPECT_LT(error_of(estimate, truth).force, 0.05);
    }
    const Estimate again = decouple(*map, strains(truth));  // the wire is back
    EXPECT_EQ(again.reasons & TACTILED_MISSING_CHANNEL, 0u);
    EXPECT_LT(error_of(again, truth).force, 0.05);
}

TEST(TableMap, RestIsGoodAndASmallForceHasNoPoint) {
    const auto map = make_decoupler(map_calibration());
    const Estimate rest = decouple(*map, std::vector<double>(8, 0.0));
    EXPECT_EQ(rest.quality, TACTILED_GOOD);
    for (std::size_t c = 0; c < 5; ++c) EXPECT_EQ(rest.wrench_S[c], 0);
    const Estimate small = decouple(*map, strains({0.66e-3, 0.02e-3, {0, 0, -0.01}}));  // 10 mN above a column
    EXPECT_EQ(small.quality, TACTILED_UNCERTAIN);
    EXPECT_NE(small.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);
    EXPECT_EQ(small.wrench_S[3], 0);
    EXPECT_EQ(small.wrench_S[4], 0);
}

TEST(TableMap, WhatNoPointExplainsIsDisagreement) {
    const auto map = make_decoupler(map_calibration());
    const Estimate estimate = decouple(*map, {1e-3, -1e-3, -1e-3, 1e-3, 1e-3, 1e-3, -1e-3, 1e-3});
    EXPECT_EQ(estimate.quality, TACTILED_UNCERTAIN);
    EXPECT_NE(estimate.reasons & TACTILED_DISAGREEMENT, 0u);
    EXPECT_TRUE(std::isnan(estimate.sd[2]));
}

TEST(TableMap, IsFiniteOrBadForEveryPatternOfBrokenNumbers) {
    const auto map = make_decoupler(map_calibration());
    const double inf = std::numeric_limits<double>::infinity();
    const std::array<double, 9> kinds{4e-4, -2e-3, kNaN, inf, -inf, 1e308, -1e200, 5e-324, 1e150};
    std::mt19937 random(20260301);
    const Contact truth{0.3e-3, 0.2e-3, {0.1, 0, -1}};
    for (int i = 0; i < 5000; ++i) {
        auto reading = strains(truth);
        for (auto& r : reading)
            if (random() % 4 == 0) r = kinds[random() % kinds.size()];
        const Estimate estimate = decouple(*map, reading, std::uint32_t(random() & random() & random()),
                                           std::uint32_t(random() & random() & random()));
        for (std::size_t c = 0; c < 5; ++c)
            ASSERT_EQ(std::isfinite(estimate.wrench_S[c]), estimate.quality != TACTILED_BAD) << i;
        if (estimate.quality != TACTILED_GOOD) { ASSERT_NE(estimate.reasons, 0u); }
        ASSERT_TRUE(std::isnan(estimate.wrench_S[5]));
    }
    EXPECT_LT(error_of(decouple(*map, strains(truth)), truth).force, 0.02);  // nothing was poisoned
}

TEST(TableMap, AUniformContactIsReadWithTheMeanOfTheMap) {
    Calibration calibration = map_calibration();
    calibration.parameters["contact"] = 0;
    calibration.components = {"fx", "fy", "fz"};
    calibration.sd = {0.01, 0.01, 0.01};
    const auto map = make_decoupler(calibration);
    const auto uniform = fem_compliance();
    std::vector<double> reading;
    for (const auto& row : uniform) reading.push_back(0.3 * row[0] - 0.2 * row[1] - 1.0 * row[2]);
    const Estimate estimate = decouple(*map, reading);
    EXPECT_NEAR(estimate.wrench_S[0], 0.3, 0.02);
    EXPECT_NEAR(estimate.wrench_S[1], -0.2, 0.02);
    EXPECT_NEAR(estimate.wrench_S[2], -1.0, 0.04);
}

std::string refusal(const Calibration& calibration) {
    Problems problems;
    EXPECT_EQ(make_decoupler(calibration, problems), nullptr);
    return problems.empty() ? "" : problems.lines().front();
}

TEST(TableMap, RefusesCalibrationsThatItCannotUse) {
    Calibration calibration = map_calibration();
    calibration.tables.erase("influence");
    EXPECT_NE(refusal(calibration).find("table influence is missing"), std::string::npos);
    calibration = map_calibration();
    calibration.tables["influence"].pop_back();
    EXPECT_NE(refusal(calibration).find("rings"), std::string::npos);
    calibration = map_calibration();
    calibration.tables["influence"][30][0] += 1e-5;
    EXPECT_NE(refusal(calibration).find("not on the grid"), std::string::npos);
    calibration = map_calibration();
    calibration.parameters.erase("gauge_factor");
    EXPECT_NE(refusal(calibration).find("gauge_factor"), std::string::npos);
    calibration = map_calibration();
    calibration.parameters["contact"] = 3;
    EXPECT_NE(refusal(calibration).find("contact = 3"), std::string::npos);
    calibration = map_calibration();
    calibration.parameters["contact"] = 2;
    calibration.components = {"fx", "fy", "fz"};
    calibration.sd = {1, 1, 1};
    EXPECT_NE(refusal(calibration).find("table rigid is missing"), std::string::npos);
    calibration = map_calibration();
    calibration.parameters["gauge_facto"] = 3;
    EXPECT_NE(refusal(calibration).find("did you mean gauge_factor?"), std::string::npos);
}

TEST(TableMap, RunsFromTheShippedCalibration) {
    Problems problems;
    const Calibration shipped = load_calibration(TACTILED_SOURCE_DIR "/config/calibration/table_influence.toml", problems);
    problems.throw_if_any();
    const auto map = make_decoupler(shipped);
    const Contact truth{-0.31e-3, 0.12e-3, {0.1, 0.2, -0.7}};
    auto reading = strains(truth);
    for (auto& r : reading) r *= 2;  // gauge factor
    const Estimate estimate = decouple(*map, reading);
    EXPECT_LT(error_of(estimate, truth).point_m, 2e-6);
    EXPECT_LT(error_of(estimate, truth).force, 0.01);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_UNKNOWN_UNCERTAINTY});
}

// A finger that slides, lifts without a sample in between, and lands elsewhere: following the last point finds no worse.
TEST(TableMap, FollowsAFingerAndItsJumps) {
    const auto warm = make_decoupler(map_calibration()), cold = make_decoupler(map_calibration());
    std::mt19937_64 random(6);
    std::vector<double> warm_points, warm_forces, cold_points;
    for (int landing = 0; landing < 100; ++landing) {
        Contact at = random_contact(random, 0.6e-3), to = random_contact(random, 0.6e-3);
        for (int i = 0; i <= 40; ++i) {
            Contact truth = at;
            truth.x_m += (to.x_m - at.x_m) * i / 40;
            truth.y_m += (to.y_m - at.y_m) * i / 40;
            const auto reading = noisy(strains(truth), Noise::kOfEach, random);
            const Error error = error_of(decouple(*warm, reading), truth);
            warm_points.push_back(error.point_m);
            warm_forces.push_back(error.force);
            (void)cold->decouple({.channel = {}});
            cold_points.push_back(error_of(decouple(*cold, reading), truth).point_m);
        }
    }
    std::printf("a finger that slides and jumps within 0.6 mm, noise 1 %% of each reading:\n");
    Percentiles(warm_points).print("map, following: point", 1e6, "um");
    Percentiles(warm_forces).print("map, following: force vector", 100, "%");
    Percentiles(cold_points).print("map, each sample anew: point", 1e6, "um");
    EXPECT_LT(Percentiles(warm_points).p99, 15e-6);
    EXPECT_LT(Percentiles(warm_forces).p50, 0.02);
    EXPECT_LT(Percentiles(warm_points).p95, 1.5 * Percentiles(cold_points).p95);
}

// The minimum beside the last point can explain the readings of a jump within the gain error, with a pull for a press.
TEST(TableMap, AJumpIsSearchedAnew) {
    const auto warm = make_decoupler(map_calibration()), cold = make_decoupler(map_calibration());
    std::mt19937_64 random(3);
    int good = 0, pulls = 0, cold_pulls = 0;
    const auto is_pull = [](const Estimate& e) { return e.quality == TACTILED_GOOD && e.wrench_S[2] > -0.3; };  // N
    for (int jump = 0; jump < 2000; ++jump) {
        const Contact contact = random_contact(random, 0.6e-3, 0.6, 0.35);
        const auto reading = strains(contact);
        for (int i = 0; i < 4; ++i) {
            const Estimate estimate = decouple(*warm, reading);
            good += estimate.quality == TACTILED_GOOD ? 1 : 0;
            pulls += is_pull(estimate) ? 1 : 0;
            (void)cold->decouple({.channel = {}});
            cold_pulls += is_pull(decouple(*cold, reading)) ? 1 : 0;
        }
    }
    EXPECT_GT(good, 7000);
    // On from the last point alone it would be 40 samples.
    EXPECT_EQ(pulls, 0);
    EXPECT_EQ(cold_pulls, 0);
    std::printf("  jumps: %d samples, %d read as a pull; %d if searched anew each time\n", 4 * 2000, pulls, cold_pulls);
}

TEST(TableMap, CostsFewMicrosecondsWarm) {
    const auto map = make_decoupler(map_calibration());
    std::mt19937_64 random(3);
    std::vector<std::vector<double>> readings;
    for (int i = 0; i < 5000; ++i) {  // a finger that circles: 0.5 mm, one turn in 500 samples
        const double angle = 2 * std::numbers::pi * i / 500;
        readings.push_back(
            noisy(strains({0.5e-3 * std::cos(angle), 0.5e-3 * std::sin(angle), {0.2, 0.1, -1}}), Noise::kOfTheMean, random));
    }
    double best_us = 1e9, worst_us = 0;
    for (int trial = 0; trial < 20; ++trial) {
        const auto begun = std::chrono::steady_clock::now();
        for (const auto& reading : readings) (void)decouple(*map, reading);
        best_us =
            std::min(best_us, std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begun).count() /
                                  double(readings.size()));
    }
    for (const auto& reading : readings) {
        (void)map->decouple({.channel = {}});
        const auto begun = std::chrono::steady_clock::now();
        (void)decouple(*map, reading);
        worst_us =
            std::max(worst_us, std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begun).count());
    }
    std::printf("map: %.2f us a sample, warm (mean, best of 20 runs); a search anew: at most %.1f us\n", best_us, worst_us);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    EXPECT_LT(best_us, 20);  // 5 on a quiet machine
#endif
}

}  // namespace
}  // namespace tactiled
