// The curved domain: what a reading of a strongly curved sensor may be, all channels together.
//
// Ways in which this check could be wrong, each with a test below:
// 1. A damaged photodiode is GOOD and wrong, because the curvature passes for free motion.
// 2. An undamaged later session, or loads together that came one by one, are outside.
// 3. A linear sensor gets the check, too, which costs time and finds nothing.
// 4. The distance depends on the unit and the zero of a channel, or the loop computes another one than the file states.
// 5. Products of large numbers hide a reading that the joint domain finds, or both factors multiply the sd.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "config/calibration.hpp"
#include "decoupling/curved_distance.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/joint_domain.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kDiodes = 10;
constexpr double kFull_N[3]{8, 8, 15};

// Photodiodes around a soft body: each one's current is an exponential function of a mixture of the components.
class Optical : public ::testing::Test {
protected:
    Optical() {
        for (std::size_t k = 0; k < kDiodes; ++k) {
            const double angle = 0.628 * double(k), side = 0.4 + 0.03 * double(k);
            gain_[k] = {side * std::cos(angle), side * std::sin(angle), -0.8 - 0.04 * double(k)};
        }
    }
    std::vector<double> reading(const Wrench& wrench_S, double noise = 3) {
        std::vector<double> channel(kDiodes);
        for (std::size_t k = 0; k < kDiodes; ++k) {
            double bend = 0;
            for (std::size_t c = 0; c < 3; ++c) bend += gain_[k][c] * wrench_S[c] / kFull_N[c];
            channel[k] = 1000 * std::exp(curvature_ * bend) + noise * normal_(random_);
        }
        return channel;
    }
    // A press with shear, up to full scale; 0 .. 1.
    Wrench load(double press) {
        const auto part = [&] { return std::uniform_real_distribution<double>(-0.8, 0.8)(random_); };
        return {kFull_N[0] * part() * press, kFull_N[1] * part() * press, -kFull_N[2] * press, kNaN, kNaN, kNaN};
    }
    // `sessions` sessions of 400 rows: a load that goes up and down.
    Labelled record(std::size_t sessions) {
        Labelled labelled;
        labelled.name = "made";
        for (std::size_t k = 0; k < kDiodes; ++k) labelled.channels.push_back("o" + std::to_string(k));
        for (std::size_t s = 0; s < sessions; ++s) {
            labelled.sessions.push_back(std::to_string(s + 1));
            for (std::size_t i = 0; i < 400; ++i) {
                const Wrench wrench = load(std::abs(std::sin(0.37 * double(i))));
                labelled.rows.push_back({.line = std::int64_t(labelled.rows.size()) + 2,
                                         .channel = reading(wrench),
                                         .wrench_S = wrench,
                                         .session = s,
                                         .t_ns = (s * 10'000 + i) * 100'000'000});
            }
        }
        return labelled;
    }
    static Calibration calibrated(const Labelled& labelled) {
        return fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = ""}).calibration;
    }

    double curvature_ = 0.9;
    std::array<std::array<double, 3>, kDiodes> gain_{};
    std::mt19937 random_{5};
    std::normal_distribution<double> normal_;
};

// ---- 1. damage ---------------------------------------------------------------------------------------------------------

TEST_F(Optical, ADamagedDiodeIsNotGoodAndWrong) {
    const Calibration calibration = calibrated(record(3));
    ASSERT_GT(calibration.joint_domain.curved.limit, 0);
    Calibration flat = calibration;
    flat.joint_domain.curved = {};
    const auto decoupler = make_decoupler(calibration), without = make_decoupler(flat);
    const std::vector<double> rest = reading({0, 0, 0}, 0);
    int samples = 0, wrong = 0, wrong_without = 0;
    for (int i = 0; i < 400; ++i) {
        const Wrench wrench = load(std::uniform_real_distribution<double>(0.2, 1)(random_));
        const std::vector<double> sound = reading(wrench);
        for (std::size_t k = 0; k < kDiodes; ++k)
            for (const double gain : {0.0, 0.5, -1.0}) {
                std::vector<double> channel = sound;
                channel[k] = rest[k] + gain * (sound[k] - rest[k]);
                const auto is_wrong = [&](Decoupler& judge) {
                    const Estimate estimate = decouple(judge, channel);
                    bool is_off = false;
                    for (std::size_t c = 0; c < 3; ++c)
                        is_off = is_off || std::abs(estimate.wrench_S[c] - wrench[c]) > 0.1 * kFull_N[c];
                    return is_off && estimate.quality() == TACTILED_GOOD;
                };
                ++samples;
                wrong += is_wrong(*decoupler);
                wrong_without += is_wrong(*without);
            }
    }
    EXPECT_LE(wrong, samples / 1000);
    EXPECT_GE(wrong_without, samples / 200) << "the case shows nothing";
}

// ---- 2. what is not damaged ----------------------------------------------------------------------------------------------

TEST_F(Optical, ALaterSessionIsInside) {
    const Calibration calibration = calibrated(record(3));
    ASSERT_GT(calibration.joint_domain.curved.limit, 0);
    EXPECT_LE(calibration.joint_domain.curved.false_alarms, 0.005);
    const CurvedDistance distance(calibration.joint_domain);
    int inside = 0;
    for (int i = 0; i < 2000; ++i) inside += distance.squared(reading(load(0.0005 * i)).data()) <= 1;
    EXPECT_GE(inside, 1998);
}

// Sessions that begin with zeros of their own show how far the zero of the next one may be.
TEST_F(Optical, ASessionWithAnotherZeroIsInside) {
    Labelled labelled = record(4);
    const auto zeros = [&] {
        std::vector<double> zero(kDiodes);
        for (double& each : zero) each = 40 * normal_(random_);
        return zero;
    };
    std::vector<double> zero;
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        if (i % 400 == 0) zero = zeros();
        for (std::size_t k = 0; k < kDiodes; ++k) labelled.rows[i].channel[k] += zero[k];
    }
    const Calibration calibration = calibrated(labelled);
    if (calibration.joint_domain.curved.limit == 0) return;
    const CurvedDistance distance(calibration.joint_domain);
    int inside = 0;
    for (int session = 0; session < 20; ++session) {
        zero = zeros();
        for (int i = 0; i < 100; ++i) {
            std::vector<double> channel = reading(load(0.01 * i));
            for (std::size_t k = 0; k < kDiodes; ++k) channel[k] += zero[k];
            inside += distance.squared(channel.data()) <= 1;
        }
    }
    EXPECT_GE(inside, 1980);
}

// Two sessions show two directions in which gains may differ, and the next one differs in others.
TEST_F(Optical, AThirdSessionWithOtherGainsIsInside) {
    std::vector<double> gain(kDiodes);
    const auto next_gains = [&] {
        for (double& each : gain) each = 1 + 0.02 * normal_(random_);
    };
    const auto with_gains = [&](std::vector<double> channel) {
        for (std::size_t k = 0; k < kDiodes; ++k) channel[k] = 1000 + gain[k] * (channel[k] - 1000);
        return channel;
    };
    Labelled labelled = record(2);
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        if (i % 400 == 0) next_gains();
        labelled.rows[i].channel = with_gains(labelled.rows[i].channel);
    }
    const Calibration calibration = calibrated(labelled);
    ASSERT_GT(calibration.joint_domain.curved.limit, 0);
    const CurvedDistance distance(calibration.joint_domain);
    int inside = 0;
    for (int session = 0; session < 20; ++session) {
        next_gains();
        for (int i = 0; i < 100; ++i) inside += distance.squared(with_gains(reading(load(0.01 * i))).data()) <= 1;
    }
    EXPECT_GE(inside, 1980);
}

TEST_F(Optical, LoadsThatCameOneByOneMayComeTogether) {
    Labelled labelled = record(3);
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        auto& row = labelled.rows[i];
        for (std::size_t c = 0; c < 3; ++c)
            if (c != i / 5 % 3) row.wrench_S[c] = 0;
        row.channel = reading(row.wrench_S);
    }
    const Calibration calibration = calibrated(labelled);
    if (calibration.joint_domain.curved.limit == 0) return;
    const CurvedDistance distance(calibration.joint_domain);
    int inside = 0;
    for (int i = 0; i < 2000; ++i) inside += distance.squared(reading(load(0.0005 * i)).data()) <= 1;
    EXPECT_GE(inside, 1980);
}

// ---- 3. no use ---------------------------------------------------------------------------------------------------------

TEST_F(Optical, ALinearSensorHasNone) {
    curvature_ = 0.005;
    Labelled labelled = record(3);
    for (auto& row : labelled.rows) row.channel = reading(row.wrench_S, 0.02);
    const Calibration calibration = calibrated(labelled);
    EXPECT_GT(calibration.joint_domain.limit, 0);
    EXPECT_EQ(calibration.joint_domain.curved.limit, 0);
}

TEST_F(Optical, FourChannelsOfThreeComponentsHaveNone) {
    Labelled labelled = record(3);
    labelled.channels.resize(4);
    for (auto& row : labelled.rows) row.channel = {row.channel[0], row.channel[3], row.channel[5], row.channel[8]};
    EXPECT_EQ(calibrated(labelled).joint_domain.curved.limit, 0);
}

TEST_F(Optical, TooFewRowsHaveNone) {
    Labelled labelled = record(1);
    labelled.rows.resize(40);  // enough for the matrix
    EXPECT_EQ(calibrated(labelled).joint_domain.curved.limit, 0);
}

// 24 loads are enough for the matrix of five channels, but not for nine features, however often each load is repeated.
TEST_F(Optical, TooFewLoadsHaveNone) {
    Labelled labelled = record(1);
    labelled.channels.resize(5);
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        auto& row = labelled.rows[i];
        if (i % 16 != 0) row.wrench_S = labelled.rows[i / 16 * 16].wrench_S;
        const std::vector<double> all = reading(row.wrench_S);
        row.channel = {all[0], all[2], all[4], all[6], all[8]};
    }
    labelled.rows.resize(24 * 16);
    EXPECT_EQ(calibrated(labelled).joint_domain.curved.limit, 0);
}

// ---- 4. one distance -----------------------------------------------------------------------------------------------------

TEST_F(Optical, TheUnitOfAChannelDoesNotMatter) {
    Labelled labelled = record(3);
    const Calibration calibration = calibrated(labelled);
    const auto other = [](std::vector<double> channel) {
        for (std::size_t k = 0; k < kDiodes; ++k) channel[k] = 1e-6 * std::pow(10, double(k % 4)) * (channel[k] + 3e4);
        return channel;
    };
    for (auto& row : labelled.rows) row.channel = other(row.channel);
    const Calibration scaled = calibrated(labelled);
    ASSERT_GT(scaled.joint_domain.curved.limit, 0);
    const CurvedDistance distance(calibration.joint_domain), distance_scaled(scaled.joint_domain);
    for (int i = 0; i < 50; ++i) {
        std::vector<double> channel = reading(load(0.02 * i));
        channel[std::size_t(i) % kDiodes] *= 0.8;
        const double expected = distance.squared(channel.data());
        EXPECT_NEAR(distance_scaled.squared(other(channel).data()), expected, 1e-3 * expected);
    }
}

// Two channels on the parabola b = a^2: y = a, p = (y, y^2) - (0, 1), and b - 1 is the second of p.
Calibration by_hand() {
    Calibration calibration;
    calibration.path = "c.toml";
    calibration.model = "generic";
    calibration.contact_model = "unknown";
    calibration.method = "matrix";
    calibration.channels = {"a", "b"};
    calibration.zero = {0, 0};
    calibration.components = {"fz"};
    calibration.matrix = {{1, 1}};
    calibration.sd = {0.5};
    calibration.joint_domain = {.mean = {0, 1},
                                .whitening = {{0.1}, {0, 0.1}},
                                .limit = 2,
                                .false_alarms = 0,
                                .curved = {.directions = {{1, 0}},
                                           .feature_mean = {0, 1},
                                           .feature_whitening = {{1}, {0, 1}},
                                           .growth = 0.5,
                                           .coefficients = {{1, 0}, {0, 1}},
                                           .whitening = {{8}, {4, 20}},
                                           .limit = 4,
                                           .false_alarms = 0.001}};
    return calibration;
}

TEST(CurvedDomain, IsThatOfTheFile) {
    const CurvedDistance distance(by_hand().joint_domain);
    EXPECT_NEAR(distance.squared(std::vector<double>{2, 4}.data()), 0, 1e-12);
    // b is off by 1: |whitening e| = 20; p = (2, 3), so that the variance grows by 1 + 0.5 * 13.
    EXPECT_NEAR(distance.squared(std::vector<double>{2, 5}.data()), 400.0 / 16 / 7.5, 1e-12);
    EXPECT_NEAR(distance.squared(std::vector<double>{0, 0}.data()), 0, 1e-12);
    EXPECT_NEAR(distance.squared(std::vector<double>{0, 1}.data()), 400.0 / 16 / 1.5, 1e-12);
}

TEST(CurvedDomain, TheGreaterDistanceWidensTheStandardDeviationOnce) {
    const auto decoupler = make_decoupler(by_hand());
    const Estimate inside = decouple(*decoupler, {2, 4});
    EXPECT_EQ(inside.quality(), TACTILED_GOOD);
    EXPECT_EQ(inside.sd[2], 0.5);
    const Estimate outside = decouple(*decoupler, {2, 5});
    EXPECT_EQ(outside.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(outside.reasons, TACTILED_OUTSIDE_DOMAIN);
    EXPECT_NEAR(outside.sd[2], 0.5 * std::sqrt(400.0 / 16 / 7.5), 1e-12);
    // Joint distance 4, limit 2; curved: off by 41 at p = (0, -1).
    const Estimate both = decouple(*decoupler, {0, 41});
    EXPECT_NEAR(both.sd[2], 0.5 * std::sqrt(820.0 * 820 / 16 / 1.5), 1e-9);
    EXPECT_EQ(decouple(*decoupler, {40, 1600}).quality(), TACTILED_UNCERTAIN) << "on the curve, but far from the rows";
}

// ---- 5. extremes and the file --------------------------------------------------------------------------------------------

TEST(CurvedDomain, AnyBitsAreNotGoodAndHaveAFiniteStandardDeviation) {
    const auto decoupler = make_decoupler(by_hand());
    for (const double odd : {1e100, 1e160, 1e300, -1e300, std::numeric_limits<double>::infinity()})
        for (const std::vector<double>& channel : {std::vector<double>{odd, 1}, {0, odd}, {odd, odd}}) {
            const Estimate estimate = decouple(*decoupler, channel);
            EXPECT_NE(estimate.quality(), TACTILED_GOOD) << odd;
            if (estimate.quality() == TACTILED_UNCERTAIN) { EXPECT_TRUE(std::isfinite(estimate.sd[2])) << odd; }
        }
    EXPECT_EQ(decouple(*decoupler, {0, kNaN}, 2).quality(), TACTILED_BAD);
}

TEST(CurvedDomain, ComesBackToTheLastBit) {
    Problems problems;
    const std::string text = calibration_text(by_hand());
    const Calibration loaded = parse_calibration(text, "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(calibration_text(loaded), text);
    EXPECT_EQ(loaded.joint_domain.curved.limit, 4);
}

TEST(CurvedDomain, AFileWithoutItHasNone) {
    Calibration calibration = by_hand();
    calibration.joint_domain.curved = {};
    Problems problems;
    const Calibration loaded = parse_calibration(calibration_text(calibration), "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(loaded.joint_domain.curved.limit, 0);
    EXPECT_EQ(decouple(*make_decoupler(loaded), {2, 5}).quality(), TACTILED_GOOD);
}

TEST(CurvedDomain, OfAWrongShapeIsRefused) {
    for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
             {"directions = [\n    [1.0, 0.0],\n]", "directions = [\n    [1.0],\n]"},
             {"feature_mean = [0.0, 1.0]", "feature_mean = [0.0]"},
             {"feature_whitening = [\n    [1.0],\n    [0.0, 1.0],\n]", "feature_whitening = [\n    [1.0],\n    [1.0],\n]"},
             {"coefficients = [\n    [1.0, 0.0],\n", "coefficients = [\n    [1.0],\n"},
             {"    [4.0, 20.0],\n", "    [20.0],\n"},
             {"curved.limit = 4.0", "curved.limit = 0.0"},
             {"growth = 0.5", "growth = -0.5"}}) {
        const auto problems = problems_of(by_hand(), from, to);
        ASSERT_EQ(problems.size(), 1u) << to;
        EXPECT_NE(problems.front().find("joint_domain"), std::string::npos) << problems.front();
    }
    const auto spoil = [](auto change) {
        Calibration calibration = by_hand();
        change(calibration.joint_domain.curved);
        return refusal(calibration);
    };
    EXPECT_NE(spoil([](CurvedDomain& c) { c.directions.clear(); }).find("curved"), std::string::npos);
    EXPECT_NE(spoil([](CurvedDomain& c) { c.whitening.pop_back(); }).find("curved"), std::string::npos);
    EXPECT_NE(spoil([](CurvedDomain& c) { c.coefficients[1].pop_back(); }).find("curved"), std::string::npos);
    EXPECT_NE(spoil([](CurvedDomain& c) { c.feature_whitening[1].pop_back(); }).find("curved"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
