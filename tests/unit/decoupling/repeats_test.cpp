// The calibration records the repetition of numbers at rest.
#include "decoupling/fit/recording_checks.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace tactiled {
namespace {

// Loads that are held for `held` readings each, 10 ms apart.
Labelled held_loads(std::size_t loads, std::size_t held, const std::function<double(std::size_t)>& channel) {
    Labelled labelled{.name = "made", .channels = {"a"}, .sessions = {}, .rows = {}};
    for (std::size_t i = 0; i < loads * held; ++i)
        labelled.rows.push_back({.line = std::int64_t(i) + 2,
                                 .channel = {channel(i)},
                                 .wrench_S = {kNaN, kNaN, -double(i / held), kNaN, kNaN, kNaN},
                                 .session = 0,
                                 .t_ns = (i + 1) * 10'000'000});
    return labelled;
}

Repeats repeats(const Labelled& labelled) {
    Rows rows;
    for (const auto& row : labelled.rows) rows.push_back(&row);
    return repeats_of(rows);
}

TEST(Repeats, TheLongestRunOfAHeldLoadCounts) {
    const auto found = repeats(held_loads(5, 50, [](std::size_t i) { return i % 50 < 47 ? double(i) : 7.0; }));
    EXPECT_EQ(found.readings, std::vector<int>{3});
    EXPECT_NEAR(found.interval_s, 0.01, 1e-9);
}

TEST(Repeats, AChannelThatStandsStillWhileTheLoadIsHeldHasNoEndThatWasSeen) {
    const auto found = repeats(held_loads(5, 50, [](std::size_t i) { return double(i / 50); }));
    EXPECT_EQ(found.readings, std::vector<int>{0});
}

TEST(Repeats, LoadsOfAFewRowsDoNotTell) {
    EXPECT_TRUE(repeats(held_loads(100, 5, [](std::size_t i) { return double(i); })).readings.empty());
    EXPECT_TRUE(repeats(held_loads(2, 50, [](std::size_t i) { return double(i); })).readings.empty());
}

TEST(Repeats, ARowThatWasLeftOutEndsARun) {
    auto labelled = held_loads(5, 50, [](std::size_t i) { return i % 4 < 3 ? 7.0 : -double(i); });
    EXPECT_EQ(repeats(labelled).readings, std::vector<int>{3});
    for (auto& row : labelled.rows) row.line *= 2;  // every other row of the file
    EXPECT_TRUE(repeats(labelled).readings.empty());
}

// Loads of 0 and 1 N in turn, with noise of 3 and 30 in the channel, rounded to `step`.
Repeats of_noise(double step, double at_rest, double under_load) {
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    auto labelled = held_loads(10, 50, [&](std::size_t i) {
        return std::round((i / 50 % 2 == 0 ? at_rest : under_load) * normal(random) / step) * step;
    });
    for (auto& row : labelled.rows) row.wrench_S[2] = -double((row.line - 2) / 50 % 2);
    return repeats(labelled);
}

TEST(Repeats, TheNoiseIsThatOfTheQuieterRests) {
    for (const double under_load : {30.0, 0.3}) {  // the load itself moves, or the channel is squeezed
        const Repeats found = of_noise(0.01, 3, under_load);
        ASSERT_EQ(found.noise.size(), 1u);
        EXPECT_GT(found.noise[0], 0.7 * 3);
        EXPECT_LT(found.noise[0], 1.1 * 3);
    }
    EXPECT_EQ(of_noise(2, 3, 3).noise, std::vector<double>{0}) << "two steps of the channel do not show it";
}

TEST(Repeats, RestsOfAFewRowsTellTheNoise) {
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    auto labelled = held_loads(10, 12, [&](std::size_t) { return 3 * normal(random); });
    for (auto& row : labelled.rows) row.wrench_S[2] = -double((row.line - 2) / 12 % 2);
    const Repeats found = repeats(labelled);
    EXPECT_TRUE(found.readings.empty());
    ASSERT_EQ(found.noise.size(), 1u);
    EXPECT_NEAR(found.noise[0], 3, 1.5);
    for (auto& row : labelled.rows) row.wrench_S[2] = -1;
    EXPECT_TRUE(repeats(labelled).noise.empty()) << "no rest";
}

TEST(Repeats, ComeBackFromAFile) {
    Calibration calibration;
    calibration.path = "c.toml";
    calibration.model = "generic";
    calibration.method = "matrix";
    calibration.channels = {"a", "b"};
    calibration.zero = {0, 0};
    calibration.components = {"fz"};
    calibration.matrix = {{1, 1}};
    calibration.repeats = {.readings = {3, 0}, .interval_s = 0.0125, .noise = {0.5, 0}};
    Problems problems;
    const Calibration loaded = parse_calibration(calibration_text(calibration), "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(loaded.repeats.readings, calibration.repeats.readings);
    EXPECT_EQ(loaded.repeats.interval_s, 0.0125);
    EXPECT_EQ(loaded.repeats.noise, calibration.repeats.noise);
}

}  // namespace
}  // namespace tactiled
