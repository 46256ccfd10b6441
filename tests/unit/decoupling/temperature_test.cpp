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
        EXPECT_EQ(estimate.quality(), TACTILED_GOOD) << t_C;
        EXPECT_NEAR(estimate.wrench_S[2], -6, 0.1) << t_C;
        EXPECT_NEAR(estimate.wrench_S[0], 1, 0.03) << t_C;
    }
    const Estimate outside = at(*decoupler, 1, -6, 33, 33);
    EXPECT_EQ(outside.quality(), TACTILED_UNCERTAIN);
    EXPECT_NE(outside.reasons & TACTILED_TEMPERATURE, 0u);
}

TEST_F(Warm, WithoutATemperatureTheDeclaredRangeIsInTheStandardDeviation) {
    const Calibration calibration = calibrate();
    const auto decoupler = make_decoupler(calibration);
    const Estimate unknown = at(*decoupler, 1, -6, 24, kNaN);
    EXPECT_EQ(unknown.quality(), TACTILED_UNCERTAIN);
    EXPECT_NE(unknown.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);
    EXPECT_TRUE(std::isnan(unknown.sd[2]));
    decoupler->set_temperature({.lowest_C = 18, .highest_C = 28, .difference_K = 0});
    const Estimate declared = at(*decoupler, 1, -6, 27, kNaN);
    EXPECT_EQ(declared.quality(), TACTILED_UNCERTAIN);  // a tenth of full scale and more
    EXPECT_LT(std::abs(declared.wrench_S[2] + 6), 2 * declared.sd[2]);
    EXPECT_GT(declared.sd[2], 0.5);
    EXPECT_EQ(at(*decoupler, 1, -6, 24, 24).quality(), TACTILED_GOOD);
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

// A sensor of the documents, as if it had been calibrated, with full scales and small standard deviations.
Calibration of_documents(const std::string& model) {
    Problems problems;
    Calibration calibration =
        load_calibration(std::string(TACTILED_SOURCE_DIR) + "/config/calibration/" + model + "_documents.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    calibration.nominal = false;
    calibration.channel_least.clear();
    calibration.channel_most.clear();
    calibration.sd.assign(calibration.components.size(), 1e-4);
    return calibration;
}

// Its estimate at no load where each channel is warmer by `warmer_K`, of a model whose zeros follow by `per_K`.
Estimate at_rest(Decoupler& decoupler, const Calibration& calibration, double per_K, std::vector<double> warmer_K,
                 double said_C = kNaN) {
    std::vector<double> channel = calibration.zero;
    warmer_K.resize(channel.size());
    for (std::size_t k = 0; k < channel.size(); ++k) channel[k] += per_K * warmer_K[k];
    return decoupler.decouple({.channel = channel, .temperature_C = said_C});
}

constexpr double kPlatinum = 3e-3, kNiCr = 1.64e-4, kUndeclared = kNaN;

TEST(KnownTemperatureEffect, HairsAreNotGoodAndWrongByATenthOfAKelvinOrTwo) {
    const Calibration calibration = of_documents("hair");
    const auto decoupler = make_decoupler(calibration);
    decoupler->set_temperature({kUndeclared, kUndeclared, 0});
    EXPECT_EQ(at_rest(*decoupler, calibration, kPlatinum, {}).quality(), TACTILED_UNCERTAIN);  // a room: 10 K
    decoupler->set_temperature({23, 23.15, 0, 1e-4});
    const Estimate warmer = at_rest(*decoupler, calibration, kPlatinum, {0.15, 0.15, 0.15, 0.15});
    EXPECT_LT(warmer.wrench_S[2], -0.03);  // newtons of a press that nobody makes
    EXPECT_EQ(warmer.quality(), TACTILED_UNCERTAIN);
    EXPECT_NEAR(warmer.sd[2], -warmer.wrench_S[2], 0.05 * warmer.sd[2]);
    EXPECT_LT(warmer.sd[0], 1e-3) << "a temperature of all hairs is no shear";
    decoupler->set_temperature({23, 23, 0, 1e-4});  // constant
    EXPECT_EQ(at_rest(*decoupler, calibration, kPlatinum, {}).quality(), TACTILED_GOOD);
}

TEST(KnownTemperatureEffect, ARangeWithoutAWidthIsOnlyAsGoodAsItIsKnown) {
    const Calibration calibration = of_documents("hair");
    const auto decoupler = make_decoupler(calibration);
    const auto warmer = [&] { return at_rest(*decoupler, calibration, kPlatinum, {0.15, 0.15, 0.15, 0.15}); };
    decoupler->set_temperature({.lowest_C = 23, .highest_C = 23});  // half a kelvin, as nothing is declared
    EXPECT_EQ(warmer().reasons, std::uint32_t{TACTILED_TEMPERATURE});
    EXPECT_LT(std::abs(warmer().wrench_S[2]), warmer().sd[2]);
    decoupler->set_temperature({.lowest_C = 23, .highest_C = 23, .sd_K = 0.015});
    const Estimate known = at_rest(*decoupler, calibration, kPlatinum, {0.015, 0.015, 0.015, 0.015});
    EXPECT_EQ(known.quality(), TACTILED_GOOD);
    EXPECT_LT(std::abs(known.wrench_S[2]), known.sd[2]);
    EXPECT_NEAR(known.sd[2], 0.015 * 3e-3 / 3.74e-7 * 2.827e-5 * std::sqrt(1 + 1 / 4.), 1e-4);
}

TEST(KnownTemperatureEffect, ADifferenceBetweenTwoHairsIsInTheStandardDeviationOfTheShear) {
    const Calibration calibration = of_documents("hair");
    const auto decoupler = make_decoupler(calibration);
    decoupler->set_temperature({23, 23, 0.15, 1e-4});
    const Estimate warmer = at_rest(*decoupler, calibration, kPlatinum, {0.075, 0, -0.075, 0});
    EXPECT_GT(std::abs(warmer.wrench_S[0]), 3e-3);
    EXPECT_LT(std::abs(warmer.wrench_S[0]), 2 * warmer.sd[0]);
    EXPECT_LT(std::abs(warmer.wrench_S[2]), 2 * warmer.sd[2]);
    EXPECT_EQ(warmer.quality(), TACTILED_UNCERTAIN);
    // A single thermometer does not show the difference.
    EXPECT_EQ(at_rest(*decoupler, calibration, kPlatinum, {0.075, 0, -0.075, 0}, 23).quality(), TACTILED_UNCERTAIN);
}

TEST(KnownTemperatureEffect, ARoomIsInTheStandardDeviationOfGaugesAndPads) {
    const Calibration table = of_documents("table"), pad = of_documents("capacitive");
    const auto gauges = make_decoupler(table), pads = make_decoupler(pad);
    EXPECT_LT(at_rest(*gauges, table, 0, {}).sd[2], 2e-4);  // not set: a recording is used unchanged
    gauges->set_temperature({kUndeclared, kUndeclared, 0.5});
    pads->set_temperature({kUndeclared, kUndeclared, 0.5});
    const Estimate warm = at_rest(*gauges, table, kNiCr, std::vector<double>(table.channels.size(), 10));
    EXPECT_NEAR(warm.wrench_S[2], -0.085, 0.01);
    EXPECT_NEAR(at_rest(*gauges, table, 0, {}).sd[2], -warm.wrench_S[2], 0.01);
    std::vector<double> channel = pad.zero;
    for (double& each : channel) each *= 1 + 5e-4 * 10;
    const Estimate warm_pad = pads->decouple({.channel = channel});
    for (const std::size_t c : {0u, 1u, 2u}) EXPECT_FALSE(std::abs(warm_pad.wrench_S[c]) > 2 * warm_pad.sd[c]) << c;
    EXPECT_GT(warm_pad.sd[2], 0.05);
}

TEST(KnownTemperatureEffect, ASofterSkinIsInTheStandardDeviationOfALoad) {
    const Calibration table = of_documents("table");
    const auto gauges = make_decoupler(table);
    gauges->set_temperature({15, 35, 0, 1e-4});
    std::vector<double> channel = table.zero;
    for (std::size_t k = 0; k < channel.size(); ++k)  // a press pulls R1 R3 R5 R7
        channel[k] += (table.channels[k].back() - '0') % 2 == 1 ? 19.366e-3 : 0;
    const Estimate press = gauges->decouple({.channel = channel}), rest = at_rest(*gauges, table, 0, {});
    ASSERT_NEAR(press.wrench_S[2], -1, 0.1);
    EXPECT_NEAR(std::sqrt(press.sd[2] * press.sd[2] - rest.sd[2] * rest.sd[2]), 20 * 5e-4 * -press.wrench_S[2], 1e-3);
}

TEST(KnownTemperatureEffect, IsUnknownInAnotherUnit) {
    Calibration calibration = of_documents("table");
    calibration.channel_unit = "counts";
    const auto decoupler = make_decoupler(calibration);
    decoupler->set_temperature({kUndeclared, kUndeclared, 0.5});
    const Estimate estimate = at_rest(*decoupler, calibration, 0, {});
    EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
    EXPECT_TRUE(std::isnan(estimate.sd[2]));
    EXPECT_NE(estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);
    decoupler->set_temperature({20, 20, 0, 1e-4});  // no temperature is known exactly
    EXPECT_TRUE(std::isnan(at_rest(*decoupler, calibration, 0, {}).sd[2]));
}

// Counts the readings that it sees.
class Counting final : public Decoupler {
public:
    explicit Counting(int& seen) : seen_(seen) {}
    Estimate decouple(const Reading&) noexcept override {
        ++seen_;
        return {};
    }
    void forget() noexcept override { ++seen_; }
    std::string_view method() const noexcept override { return "counting"; }

private:
    int& seen_;
};

TEST(KnownTemperatureEffect, IsNotExaminedOnTheDecouplerThatRuns) {
    int of_first = 0, of_others = 0;
    bool is_first = true;
    const auto decoupler = with_temperature(of_documents("table"), [&] {
        auto made = std::make_unique<Counting>(is_first ? of_first : of_others);
        is_first = false;
        return made;
    });
    decoupler->set_temperature({20, 30, 0.5});
    EXPECT_EQ(of_first, 0) << "a method with hysteresis would lose what it knows";
    EXPECT_GT(of_others, 0);
}

TEST(KnownTemperatureEffect, AMeasuredTemperatureOutsideTheDeclaredRangeIsUncertain) {
    const Calibration calibration = of_documents("table");
    const auto decoupler = make_decoupler(calibration);
    decoupler->set_temperature({20, 25, 0.1});
    EXPECT_EQ(at_rest(*decoupler, calibration, 0, {}, 25.4).quality(), TACTILED_GOOD);
    const Estimate hot = at_rest(*decoupler, calibration, 0, {}, 26);
    EXPECT_EQ(hot.quality(), TACTILED_UNCERTAIN);
    EXPECT_NE(hot.reasons & TACTILED_TEMPERATURE, 0u);
}

TEST_F(Warm, ADifferenceFromTheThermometerIsInTheStandardDeviation) {
    const Calibration calibration = calibrate();
    const auto decoupler = make_decoupler(calibration);
    decoupler->set_temperature({kUndeclared, kUndeclared, 0.5});
    const Estimate behind = at(*decoupler, 1, -6, 24.5, 24);  // the gauges are warmer than their thermometer
    EXPECT_EQ(behind.quality(), TACTILED_GOOD);
    EXPECT_GT(std::abs(behind.wrench_S[2] + 6), 0.05);
    EXPECT_LT(std::abs(behind.wrench_S[2] + 6), 2 * behind.sd[2]);
}

// Hairs of one wafer, H1 .. H4 and the dummy H0: r_k = alpha_k dT + load, with coefficients that differ by a percent.
class WithADummy : public ::testing::Test {
protected:
    static constexpr double kMismatch[5] = {0.012, -0.007, 0.004, -0.011, 0.006};

    std::vector<double> reading(double tau_x_Pa, double sigma_Pa, double from_K) {
        std::vector<double> channel;
        for (std::size_t k = 0; k < 5; ++k) {
            const double shear = k == 0 ? -7.91e-7 : k == 2 ? 7.91e-7 : 0, normal = k == 4 ? 0 : 3.74e-7;
            channel.push_back(kPlatinum * (1 + kMismatch[k]) * from_K + shear * tau_x_Pa + normal * sigma_Pa +
                              5.14e-6 * normal_(random_));
        }
        return channel;
    }
    // Random loads up to 2 kPa, each for 10 rows, while the temperature walks within `width_K`.
    Labelled recording(double width_K) {
        Labelled labelled{.name = "made", .channels = {"H1", "H2", "H3", "H4", "H0"}, .sessions = {}, .rows = {}};
        std::uniform_real_distribution<double> uniform(-1, 1);
        constexpr int kTimes = 120, kHeld = 10;
        for (int load = 0; load < kTimes; ++load) {
            const double tau_x_Pa = 2000 * uniform(random_), sigma_Pa = load % 6 == 0 ? 0 : 1000 + 1000 * uniform(random_);
            for (int i = 0; i < kHeld; ++i) {
                const double from_K = width_K / 2 * std::sin(0.7 * (load + double(i) / kHeld));
                LabelledRow row{.line = load * kHeld + i + 2, .channel = reading(tau_x_Pa, sigma_Pa, from_K)};
                row.wrench_S = {tau_x_Pa * kArea_m2, 0, -sigma_Pa * kArea_m2, kNaN, kNaN, kNaN};
                row.wrench_S[1] = kNaN;
                row.t_ns = std::uint64_t(load * kHeld + i + 1) * 10'000'000;
                labelled.rows.push_back(row);
            }
        }
        return labelled;
    }
    Calibration calibrate(double width_K, double difference_K = 0.01) {
        Labelled labelled = recording(width_K);
        FitRequest request{.model = "hair", .method = "matrix", .serial = "", .channel_unit = "dR/R0", .date = ""};
        request.parameters["area_m2"] = kArea_m2;
        request.dummy = take_dummy(labelled, "hair", "dR/R0", {.at_C = 23, .difference_K = difference_K});
        return fit(labelled, request).calibration;
    }
    static Estimate at(Decoupler& decoupler, const Calibration& calibration, std::vector<double> channel) {
        const double t_C = calibration.temperature.of_dummy_C(channel.back());
        channel.pop_back();
        return decoupler.decouple({.channel = channel, .temperature_C = t_C});
    }

    static constexpr double kArea_m2 = 2.827e-5;
    std::mt19937 random_{11};
    std::normal_distribution<double> normal_;
};

TEST_F(WithADummy, TwoKelvinAreNoPressAndTheCoefficientsAreFitted) {
    const Calibration calibration = calibrate(5);
    const Temperature& t = calibration.temperature;
    ASSERT_EQ(t.dummy, "H0");
    EXPECT_EQ(calibration.channels, (std::vector<std::string>{"H1", "H2", "H3", "H4"}));
    for (std::size_t k = 0; k < 4; ++k)
        EXPECT_NEAR(t.zero_per_K[k] / t.dummy_per_K, (1 + kMismatch[k]) / (1 + kMismatch[4]),
                    6 * t.zero_per_K_sd[k] / kPlatinum);
    const auto decoupler = make_decoupler(calibration);
    decoupler->set_temperature({});
    for (const double from_K : {-2.0, 0.0, 2.0}) {
        const Estimate estimate = at(*decoupler, calibration, reading(500, 1000, from_K));
        EXPECT_EQ(estimate.quality(), TACTILED_GOOD) << from_K << " " << estimate.reasons;
        EXPECT_NEAR(estimate.wrench_S[2], -1000 * kArea_m2, 5 * estimate.sd[2]) << from_K;
        EXPECT_LT(estimate.sd[2], 0.1 * 2000 * kArea_m2);
    }
}

TEST_F(WithADummy, StatedCoefficientsAreInAStandardDeviationThatGrowsWithTheTemperature) {
    const Calibration calibration = calibrate(0.5);  // too little to fit
    EXPECT_GT(calibration.temperature.dummy_per_K_sd, 0);
    const auto decoupler = make_decoupler(calibration);
    decoupler->set_temperature({});
    const Estimate near = at(*decoupler, calibration, reading(0, 1000, 0.1)),
                   far = at(*decoupler, calibration, reading(0, 1000, 1.8)),
                   beyond = at(*decoupler, calibration, reading(0, 1000, 6));
    EXPECT_EQ(near.quality(), TACTILED_GOOD);
    EXPECT_EQ(far.quality(), TACTILED_GOOD);
    EXPECT_LT(std::abs(far.wrench_S[2] + 1000 * kArea_m2), 3 * far.sd[2]);
    EXPECT_NEAR(far.sd[2] / near.sd[2], 2, 0.7);
    EXPECT_EQ(beyond.reasons & TACTILED_TEMPERATURE, std::uint32_t{TACTILED_TEMPERATURE});
    EXPECT_NE(beyond.quality(), TACTILED_GOOD);
    EXPECT_FALSE(std::abs(beyond.wrench_S[2] + 1000 * kArea_m2) > 3 * beyond.sd[2]);  // NaN: not known
}

TEST_F(WithADummy, ADummyWithoutAValueLeavesTheHairsAsWithoutOne) {
    const Calibration calibration = calibrate(5);
    const auto decoupler = make_decoupler(calibration);
    decoupler->set_temperature({.lowest_C = 21, .highest_C = 25});
    std::vector<double> channel = reading(0, 1000, 1.5);
    channel.back() = kNaN;
    const Estimate estimate = at(*decoupler, calibration, channel);
    EXPECT_EQ(estimate.reasons & TACTILED_TEMPERATURE, std::uint32_t{TACTILED_TEMPERATURE});
    EXPECT_LT(std::abs(estimate.wrench_S[2] + 1000 * kArea_m2), estimate.sd[2]);
}

// Without a thermometer the reading counts as one at the reference, 23 degC.
TEST_F(WithADummy, ADeclaredRangeFarFromTheReferenceIsInTheStandardDeviation) {
    const Calibration calibration = calibrate(5);
    const auto decoupler = make_decoupler(calibration);
    decoupler->set_temperature({.lowest_C = 24.5, .highest_C = 24.5, .sd_K = 0.01});
    std::vector<double> channel = reading(0, 1000, 1.5);
    channel.back() = kNaN;
    const Estimate estimate = at(*decoupler, calibration, channel);
    EXPECT_NE(estimate.quality(), TACTILED_GOOD);
    EXPECT_LT(std::abs(estimate.wrench_S[2] + 1000 * kArea_m2), 3 * estimate.sd[2]);
}

TEST_F(WithADummy, AnotherUnitOrADummyThatIsNotThereIsRefused) {
    Labelled labelled = recording(1);
    const DummyStated stated{.at_C = 23, .difference_K = 0.01};
    EXPECT_THROW((void)take_dummy(labelled, "hair", "counts", stated), SetupError);
    EXPECT_THROW((void)take_dummy(labelled, "generic", "", stated), SetupError);
    (void)take_dummy(labelled, "hair", "", stated);
    EXPECT_THROW((void)take_dummy(labelled, "hair", "", stated), SetupError) << "H0 is taken";
}

TEST_F(WithADummy, ADifferenceThatIsNotStatedIsAskedFor) {
    Labelled labelled = recording(1);
    try {
        (void)take_dummy(labelled, "hair", "dR/R0", {.at_C = 23});
        FAIL();
    } catch (const SetupError& error) {
        EXPECT_NE(std::string(error.what()).find("state --dummy-difference-K 0.01"), std::string::npos) << error.what();
    }
    EXPECT_TRUE(take_dummy(labelled, "generic", "", {}).dummy.empty()) << "H0 is a channel of any name there";
    EXPECT_EQ(labelled.channels.size(), 5u);
}

TEST_F(WithADummy, ComesBackFromAFile) {
    Calibration calibration = calibrate(5);
    calibration.path = "c.toml";
    Problems problems;
    const std::string text = calibration_text(calibration);
    const Calibration loaded = parse_calibration(text, "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(calibration_text(loaded), text);
    EXPECT_EQ(loaded.temperature.zero_per_K_sd, calibration.temperature.zero_per_K_sd);
    EXPECT_EQ(loaded.temperature.dummy_zero, calibration.temperature.dummy_zero);
}

}  // namespace
}  // namespace tactiled
