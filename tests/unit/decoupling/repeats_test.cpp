// The calibration records the repetition of numbers at rest.
#include "decoupling/fit/recording_checks.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

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

TEST(Repeats, ComeBackFromAFile) {
    Calibration calibration;
    calibration.path = "c.toml";
    calibration.model = "generic";
    calibration.method = "matrix";
    calibration.channels = {"a", "b"};
    calibration.zero = {0, 0};
    calibration.components = {"fz"};
    calibration.matrix = {{1, 1}};
    calibration.repeats = {.readings = {3, 0}, .interval_s = 0.0125};
    Problems problems;
    const Calibration loaded = parse_calibration(calibration_text(calibration), "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(loaded.repeats.readings, calibration.repeats.readings);
    EXPECT_EQ(loaded.repeats.interval_s, 0.0125);
}

}  // namespace
}  // namespace tactiled
