// The thermometer has no value after a failure, a standstill, a jump or an exchange.
#include "node/thermometer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tactiled {
namespace {

constexpr std::uint64_t kSecond = 1'000'000'000;

class ThermometerTest : public ::testing::Test {
protected:
    // `seconds` of readings at 100 Hz; returns the last one.
    double read(double t_C, double seconds = 0.01) {
        double last = std::numeric_limits<double>::quiet_NaN();
        for (int i = 0; i < int(std::lround(seconds * 100)); ++i) last = thermometer.judge(t_C, now_ns += kSecond / 100);
        return last;
    }
    Tuning tuning;
    Thermometer thermometer{tuning};
    std::uint64_t now_ns = kSecond;
};

TEST_F(ThermometerTest, FollowsARoomAndItsOwnNoise) {
    for (int i = 0; i < 36'000; ++i) {
        const double t_C = 20 + 0.05 * i / 100.0 + (i % 3) * 0.3;  // 3 K a minute
        ASSERT_EQ(read(t_C), t_C) << i;
    }
}

TEST_F(ThermometerTest, AJumpIsDoubtfulUntilItReturnsAndNotOnlyForAWhile) {
    EXPECT_EQ(read(23, 10), 23);
    EXPECT_TRUE(std::isnan(read(26)));
    EXPECT_TRUE(std::isnan(read(26, 3600)));  // another thermometer
    EXPECT_EQ(read(23.2), 23.2);
}

TEST_F(ThermometerTest, ARampFasterThanABoardWarmsUpIsDoubtful) {
    EXPECT_EQ(read(23), 23);
    double t_C = 23;
    int believed = 0;
    for (; t_C < 33; t_C += 0.02) believed += std::isfinite(read(t_C)) ? 1 : 0;  // 2 K/s
    EXPECT_LT(believed, 60);                                                     // a kelvin, not ten
}

TEST_F(ThermometerTest, WithoutAReadingItHasNoValueAndMayChangeAsARoomDoes) {
    EXPECT_EQ(read(23), 23);
    EXPECT_TRUE(std::isnan(read(std::numeric_limits<double>::quiet_NaN())));
    now_ns += 2 * kSecond;
    EXPECT_TRUE(std::isnan(read(28)));  // plugged into another one
    EXPECT_TRUE(std::isnan(read(28, 600)));
    now_ns += 60 * kSecond;
    EXPECT_EQ(read(28), 28);  // a room, too, may change by 5 K in a minute without a reading
}

TEST_F(ThermometerTest, StandingStillIsFrozenWhereItIsDeclaredAndMovesTwiceToBeAlive) {
    EXPECT_EQ(read(23, 10), 23);
    tuning.thermometer_frozen_after = 100;
    EXPECT_TRUE(std::isnan(read(23, 1)));
    EXPECT_TRUE(std::isnan(read(23.01)));
    EXPECT_EQ(read(23.02), 23.02);
}

TEST_F(ThermometerTest, ATareBelievesThePresentTemperatureAndOneThatFailsDoesNot) {
    EXPECT_EQ(read(23), 23);
    EXPECT_TRUE(std::isnan(read(30)));
    thermometer.begin_tare();
    EXPECT_EQ(read(30), 30);
    thermometer.fail_tare();
    EXPECT_TRUE(std::isnan(read(30)));
    thermometer.begin_tare();
    EXPECT_EQ(read(30, 1), 30);
    EXPECT_TRUE(std::isnan(read(23)));
}

}  // namespace
}  // namespace tactiled
