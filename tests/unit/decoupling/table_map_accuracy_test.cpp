// Method "map" against finite elements: its error over the plate, compared with method "linear" and with the limit by
// noise.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "decoupling/table/influence_map.hpp"
#include "map_contacts.hpp"

namespace tactiled {
namespace {

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
            (void)map->decouple({.channel = {}});  // another device: clears the last point
            const Estimate estimate = decouple(*map, reading);
            const Error error = error_of(estimate, truth);
            points.push_back(error.point_m);
            forces.push_back(error.force);
            normals.push_back(error.normal);
            if (estimate.quality() == TACTILED_GOOD) {
                within_sd += std::abs(estimate.wrench_S[2] - truth.force_N[2]) < estimate.sd[2] ? 1 : 0;
                good_points.push_back(error.point_m);
                good_forces.push_back(error.force);
            }
            good += estimate.quality() == TACTILED_GOOD ? 1 : 0;
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

// First touches, each searched over the whole plate: a wrong minimum is not marked GOOD.
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
            if (estimate.quality() != TACTILED_GOOD) continue;
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
        // Noise in all readings as large as the allowed gain error: the force is nonlinear within a few sd.
        EXPECT_LE(far, noise == Noise::kOfTheMean ? 3 : 0);
    }
}

// Noise: each reading has an independent error of 1 % of its value, normally distributed, and 1e-6 of strain. The
// bound is that of Cramer and Rao: no unbiased estimator of five unknowns has a smaller covariance than (J' W J)^-1.
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
        // Computed from the weighted J: inverse * inverse' is the bound.
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
        if (estimate.quality() != TACTILED_GOOD) continue;
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

}  // namespace
}  // namespace tactiled
