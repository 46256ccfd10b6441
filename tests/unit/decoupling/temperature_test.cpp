// Zero and gain against temperature: learnt from rows with temperature_C, and taken off each reading.
#include "decoupling/temperature.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

// Four channels that answer a press and a shear, with zeros that move by up to 3 % of their range per kelvin.
class Warm : public ::testing::Test {
protected:
    Warm() {
        labelled.channels = {"a", "b", "c", "d"};
        std::uniform_real_distribution<double> uniform(-1, 1);
        for (std::size_t i = 0; i < 800; ++i) {
            const double fx = 2 * uniform(random_), fz = -5 + 5 * uniform(random_), t_C = 22 + 6 * uniform(random_);
            labelled.rows.push_back({.line = std::int64_t(i) + 2,
                                     .channel = reading(fx, fz, t_C),
                                     .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN},
                                     .session = 0,
                                     .t_ns = (i + 1) * 1'000'000'000,
                                     .temperature_C = t_C});
        }
    }
    std::vector<double> reading(double fx, double fz, double t_C) {
        constexpr double kGain[4][2] = {{1, 0.3}, {-1, 0.3}, {0.1, 0.5}, {0, -0.4}}, kPerK[4] = {0.1, 0.08, 0.12, -0.05};
        std::vector<double> channel;
        for (std::size_t k = 0; k < 4; ++k)
            channel.push_back(2 + (kGain[k][0] * fx + kGain[k][1] * fz) * (1 + 0.003 * (t_C - 20)) + kPerK[k] * (t_C - 20) +
                              0.002 * normal_(random_));
        return channel;
    }
    Calibration calibrate() {
        return fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = ""}).calibration;
    }
    Estimate at(Decoupler& decoupler, double fx, double fz, double t_C, double said_C) {
        const auto channel = reading(fx, fz, t_C);
        return decoupler.decouple({.channel = channel, .temperature_C = said_C});
    }

    std::mt19937 random_{7};
    std::normal_distribution<double> normal_;
    Labelled labelled{.name = "made", .channels = {}, .sessions = {}, .rows = {}};
};

TEST_F(Warm, ThePressIsTheSameAtEachTemperatureOfTheCalibration) {
    const Calibration calibration = calibrate();
    ASSERT_EQ(calibration.temperature.zero_per_K.size(), 4u);
    EXPECT_NEAR(calibration.temperature.zero_per_K[0], 0.1, 0.002);
    EXPECT_NEAR(calibration.temperature.gain_per_K[0], 0.003, 0.0003);
    const auto decoupler = make_decoupler(calibration);
    for (const double t_C : {16.5, 20.0, 27.5}) {
        const Estimate estimate = at(*decoupler, 1, -6, t_C, t_C);
        EXPECT_EQ(estimate.quality, TACTILED_GOOD) << t_C;
        EXPECT_NEAR(estimate.wrench_S[2], -6, 0.1) << t_C;
        EXPECT_NEAR(estimate.wrench_S[0], 1, 0.03) << t_C;
    }
    const Estimate outside = at(*decoupler, 1, -6, 33, 33);
    EXPECT_EQ(outside.quality, TACTILED_UNCERTAIN);
    EXPECT_NE(outside.reasons & TACTILED_OUTSIDE_DOMAIN, 0u);
}

TEST_F(Warm, WithoutATemperatureTheDeclaredRangeIsInTheStandardDeviation) {
    const Calibration calibration = calibrate();
    const auto decoupler = make_decoupler(calibration);
    const Estimate unknown = at(*decoupler, 1, -6, 24, kNaN);
    EXPECT_EQ(unknown.quality, TACTILED_UNCERTAIN);
    EXPECT_NE(unknown.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);
    EXPECT_TRUE(std::isnan(unknown.sd[2]));
    decoupler->set_temperature_range(10);
    const Estimate declared = at(*decoupler, 1, -6, 27, kNaN);
    EXPECT_EQ(declared.quality, TACTILED_UNCERTAIN);  // a tenth of full scale and more
    EXPECT_LT(std::abs(declared.wrench_S[2] + 6), 2 * declared.sd[2]);
    EXPECT_GT(declared.sd[2], 0.5);
    EXPECT_EQ(at(*decoupler, 1, -6, 24, 24).quality, TACTILED_GOOD);
}

TEST_F(Warm, TooSmallARangeTeachesNothing) {
    std::erase_if(labelled.rows, [](const LabelledRow& row) { return std::abs(row.temperature_C - 22) > 0.9; });
    EXPECT_TRUE(calibrate().temperature.zero_per_K.empty());
}

TEST_F(Warm, ComesBackFromAFile) {
    Calibration calibration = calibrate();
    calibration.path = "c.toml";
    Problems problems;
    const Calibration loaded = parse_calibration(calibration_text(calibration), "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(loaded.temperature.zero_per_K, calibration.temperature.zero_per_K);
    EXPECT_EQ(loaded.temperature.gain_per_K, calibration.temperature.gain_per_K);
    EXPECT_EQ(loaded.temperature.range_C, calibration.temperature.range_C);
    calibration.temperature.zero.pop_back();
    EXPECT_NE(refusal(calibration).find("temperature"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
