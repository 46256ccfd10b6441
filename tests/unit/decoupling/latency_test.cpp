// The part of the standard deviation that a delay makes.
#include "decoupling/latency.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace tactiled {
namespace {

Wrench all_of(double delay_s) {
    Wrench delays_s;
    delays_s.fill(delay_s);
    return delays_s;
}

constexpr std::uint64_t kMs = 1'000'000;

double sd_of(Latency& latency, double fz, std::uint64_t t_ns, double sd = 0.01) {
    Wrench wrench = kUnseen, all = kUnseen;
    wrench[2] = fz;
    all[2] = sd;
    latency.widen(wrench, t_ns, all);
    EXPECT_TRUE(std::isnan(all[0]));
    return all[2];
}

TEST(Latency, AForceThatMovesIsOffByDelayTimesItsSlope) {
    Latency latency;
    latency.set_delay(all_of(0.002));
    double sd = 0;
    for (std::uint64_t i = 1; i < 10; ++i) sd = sd_of(latency, 5 * double(i), i * kMs);  // 5000 N/s
    EXPECT_NEAR(sd, std::hypot(0.01, 10), 1e-9);
}

TEST(Latency, AtRestAndWithoutADelayNothingIsAdded) {
    Latency latency;
    for (std::uint64_t i = 1; i < 10; ++i) EXPECT_EQ(sd_of(latency, 5 * double(i), i * kMs), 0.01);
    latency.set_delay(all_of(0.002));
    for (std::uint64_t i = 11; i < 20; ++i) EXPECT_EQ(sd_of(latency, 5, i * kMs), 0.01);
}

TEST(Latency, AJumpIsForgottenAfterThreeSamplesAndAtADiscontinuity) {
    Latency latency;
    latency.set_delay(all_of(0.001));
    (void)sd_of(latency, 0, 1 * kMs);
    for (std::uint64_t i = 2; i < 5; ++i) EXPECT_GT(sd_of(latency, 9, i * kMs), 1) << i;
    EXPECT_EQ(sd_of(latency, 9, 5 * kMs), 0.01);
    latency.forget();
    EXPECT_EQ(sd_of(latency, 0, 6 * kMs), 0.01);
}

// The first and the last of four samples are alike, so that their slope is 0.
TEST(Latency, AVibrationIsNoRest) {
    Latency latency;
    latency.set_delay(all_of(0.001));
    for (std::uint64_t i = 1; i < 4; ++i) (void)sd_of(latency, i == 1 ? 0 : 9, i * kMs);
    EXPECT_GE(sd_of(latency, 0, 4 * kMs), 9 / std::numbers::sqrt2);
}

// A conversion of 100 ms, and a step at any time between the samples that are kept: once a seventh of it shows, the whole
// step lies within five standard deviations.
TEST(Latency, AStepWithinTheConversionIsCoveredFromASeventhOn) {
    for (std::uint64_t phase = 0; phase < 17; ++phase) {
        Latency latency;
        latency.set_delay(all_of(0.05));
        for (std::uint64_t i = 1; i <= 200 + phase; ++i) EXPECT_EQ(sd_of(latency, 0, i * kMs), 0.01);
        for (std::uint64_t i = 1; i <= 100; ++i) {
            const double shown = 10 * double(i) / 100;
            const double sd = sd_of(latency, shown, (200 + phase + i) * kMs);
            if (i < 15) continue;
            EXPECT_LT(10 - shown, 5 * sd) << i << " ms after the step, phase " << phase;
        }
    }
}

// Ten thousand samples a second and a delay of 8 ms: four samples would show a slope of noise alone.
TEST(Latency, NoiseIsNoSlopeHoweverFastTheSamplesCome) {
    Latency latency;
    latency.set_delay(all_of(0.008));
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 0.01);
    double sum = 0;
    for (std::uint64_t i = 1; i <= 1000; ++i) sum += sd_of(latency, noise(random), i * kMs / 10);
    EXPECT_LT(sum / 1000, 0.04);
}

TEST(Latency, NoiseThatWasThereFromTheStartAddsLittle) {
    Latency latency;
    latency.set_delay(all_of(0.002));
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 0.002);  // a part of the standard deviation
    std::vector<double> sds;
    for (std::uint64_t i = 1; i <= 1000; ++i)
        if (const double sd = sd_of(latency, noise(random), i * kMs); i > 70) sds.push_back(sd);
    std::sort(sds.begin(), sds.end());
    EXPECT_LT(sds[sds.size() / 2], 0.0105);
    EXPECT_LT(sds[sds.size() * 9 / 10], 0.015);
    // The load begins to move.
    double sd = 0;
    for (std::uint64_t i = 1; i < 10; ++i) sd = sd_of(latency, double(i), (1000 + i) * kMs);
    EXPECT_NEAR(sd, 2, 0.01);
}

// A shake that never rested could be noise.
TEST(Latency, AMotionThatWasThereFromTheStartIsAtLeastTheStandardDeviation) {
    Latency latency;
    latency.set_delay(all_of(0.001));
    for (std::uint64_t i = 1; i <= 1000; ++i) {
        const double sd = sd_of(latency, i % 2 == 0 ? 1 : 0, i * kMs);
        if (i > 1) { EXPECT_GE(sd, 1 / std::numbers::sqrt2); }
    }
}

TEST(Latency, EachComponentHasTheDelayOfItsOwnChannels) {
    EXPECT_EQ(measured_over_s(std::vector<double>{0.45, 0.35, 0.25, 0.15, 0.05, 0}, 0b011111), 0.5);
    EXPECT_EQ(measured_over_s(std::vector<double>{0.45, 0.35, 0.25, 0.15, 0.05, 0}, 0b010000), 0.1);
    EXPECT_EQ(measured_over_s(std::vector<double>{0.45, 0.35, 0.25, 0.15, 0.05, 0}, 0b100000), 0);
    EXPECT_EQ(measured_over_s({}), 0);
    Latency latency;
    latency.set_delay({0.002, 0.001, 0, 0, 0, 0});
    Wrench sd{};
    for (std::uint64_t i = 1; i < 10; ++i) {
        const double force_N = 5 * double(i);  // 5000 N/s
        sd = {0.01, 0.01, 0.01, 0.01, 0.01, 0.01};
        latency.widen({force_N, force_N, force_N, 0, 0, 0}, i * kMs, sd);
    }
    EXPECT_NEAR(sd[0], std::hypot(0.01, 10), 1e-9);
    EXPECT_NEAR(sd[1], std::hypot(0.01, 5), 1e-9);
    EXPECT_EQ(sd[2], 0.01);
}

TEST(Latency, AnyNumbersLeaveAFiniteStandardDeviation) {
    Latency latency;
    latency.set_delay(all_of(0.001));
    for (const double value : {1e300, -1e300, 1e160, 0.0}) {
        EXPECT_TRUE(std::isfinite(sd_of(latency, value, 5 * kMs)));
        EXPECT_TRUE(std::isfinite(sd_of(latency, -value, 6 * kMs)));
    }
    EXPECT_TRUE(std::isnan(sd_of(latency, 1, 7 * kMs, kNaN)));
}

}  // namespace
}  // namespace tactiled
