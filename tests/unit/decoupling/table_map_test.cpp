// Method "map" against finite elements: its map, gauges that are missing or broken, calibrations that it refuses.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "decoupling/table/influence_map.hpp"
#include "map_contacts.hpp"

namespace tactiled {
namespace {

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
        ASSERT_LT((at.dx - (right.value - left.value) / (2 * h)).cwiseAbs().maxCoeff(),
                  0.05);  // relative to up to 100 per N and m
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
        EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
        EXPECT_NE(estimate.reasons & TACTILED_DISAGREEMENT, 0u);
        EXPECT_NE(estimate.reasons & TACTILED_MISSING_CHANNEL, 0u);
        EXPECT_LT(error_of(estimate, truth).force, 0.05);
    }
    const Estimate again = decouple(*map, strains(truth));  // the gauge is connected again
    EXPECT_EQ(again.reasons & TACTILED_MISSING_CHANNEL, 0u);
    EXPECT_LT(error_of(again, truth).force, 0.05);
}

TEST(TableMap, RestIsGoodAndASmallForceHasNoPoint) {
    const auto map = make_decoupler(map_calibration());
    const Estimate rest = decouple(*map, std::vector<double>(8, 0.0));
    EXPECT_EQ(rest.quality(), TACTILED_GOOD);
    for (std::size_t c = 0; c < 5; ++c) EXPECT_EQ(rest.wrench_S[c], 0);
    const Estimate small = decouple(*map, strains({0.66e-3, 0.02e-3, {0, 0, -0.01}}));  // 10 mN above a column
    EXPECT_EQ(small.quality(), TACTILED_UNCERTAIN);
    EXPECT_NE(small.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);
    EXPECT_EQ(small.wrench_S[3], 0);
    EXPECT_EQ(small.wrench_S[4], 0);
}

TEST(TableMap, WhatNoPointExplainsIsDisagreement) {
    const auto map = make_decoupler(map_calibration());
    const Estimate estimate = decouple(*map, {1e-3, -1e-3, -1e-3, 1e-3, 1e-3, 1e-3, -1e-3, 1e-3});
    EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
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
            ASSERT_EQ(std::isfinite(estimate.wrench_S[c]), estimate.quality() != TACTILED_BAD) << i;
        if (estimate.quality() != TACTILED_GOOD) { ASSERT_NE(estimate.reasons, 0u); }
        ASSERT_TRUE(std::isnan(estimate.wrench_S[5]));
    }
    EXPECT_LT(error_of(decouple(*map, strains(truth)), truth).force, 0.02);  // the state was not corrupted
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

}  // namespace
}  // namespace tactiled
