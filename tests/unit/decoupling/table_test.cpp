#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "decoupling/solve/load_scale.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

struct Force {
    double x, y, z;  // N, exerted on the sensor: a press has z < 0
};

// The readings R1 .. R8 of the sensor, written from the sign table of Lee et al. and not from the code.
std::array<double, 8> gauges_of(Force f) {
    const double ti = 10847e-6, ni = 19366e-6, to = 8582e-6, n = -f.z;
    return {-ti * f.x + ni * n, +to * f.x, -ti * f.y + ni * n, +to * f.y,
            +ti * f.x + ni * n, -to * f.x, +ti * f.y + ni * n, -to * f.y};
}

std::vector<double> reading_of(const std::vector<std::string>& channels, Force f) {
    const auto all = gauges_of(f);
    std::vector<double> reading;
    for (const auto& name : channels) reading.push_back(all[std::size_t(name[1] - '1')]);
    return reading;
}

void expect_force(const Estimate& estimate, Force f, double tolerance_N) {
    EXPECT_NEAR(estimate.wrench_S[0], f.x, tolerance_N);
    EXPECT_NEAR(estimate.wrench_S[1], f.y, tolerance_N);
    EXPECT_NEAR(estimate.wrench_S[2], f.z, tolerance_N);
}

class TableOf : public testing::TestWithParam<std::vector<std::string>> {};
INSTANTIATE_TEST_SUITE_P(Wirings, TableOf,
                         testing::Values(inner_gauges(), all_gauges(), std::vector<std::string>{"R7", "R1", "R5", "R3"},
                                         std::vector<std::string>{"R8", "R1", "R2", "R7", "R6", "R5", "R4", "R3"},
                                         std::vector<std::string>{"R1", "R3", "R5", "R7", "R2", "R6"}));

TEST_P(TableOf, ReadsEveryDirectionAndEveryRowOfTheSignTable) {
    const auto decoupler = make_decoupler(table_calibration(GetParam()));
    for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
            for (int z = -1; z <= 1; ++z) {
                const Force f{0.3 * x, 0.3 * y, 1.0 * z};
                const Estimate estimate = decouple(*decoupler, reading_of(GetParam(), f));
                SCOPED_TRACE(testing::Message() << x << y << z);
                expect_force(estimate, f, 1e-15);
                EXPECT_EQ(estimate.quality(), TACTILED_GOOD);
                EXPECT_LT(estimate.residual, 1e-9);
            }
}

TEST_P(TableOf, SuperposesToRounding) {
    const auto decoupler = make_decoupler(table_calibration(GetParam()));
    const Force a{0.3, -0.1, -0.8}, b{-0.2, 0.25, -0.1};
    auto sum = reading_of(GetParam(), a);
    const auto add = reading_of(GetParam(), b);
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += add[k];
    expect_force(decouple(*decoupler, sum), {0.1, 0.15, -0.9}, 1e-15);
}

TEST_P(TableOf, SurvivesEachMissingGaugeWithALargerStandardDeviation) {
    const auto decoupler = make_decoupler(table_calibration(GetParam()));
    const Force f{0.3, -0.2, -1.0};
    for (std::size_t k = 0; k < GetParam().size(); ++k) {
        auto reading = reading_of(GetParam(), f);
        reading[k] = kNaN;
        const Estimate estimate = decouple(*decoupler, reading);
        SCOPED_TRACE(GetParam()[k]);
        expect_force(estimate, f, 2e-15);
        EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL});
        const double sum_of_sd = estimate.sd[0] + estimate.sd[1] + estimate.sd[2];
        EXPECT_GT(sum_of_sd, 0.04 * 1.01);  // N; 0.04 with all gauges
    }
}

TEST_P(TableOf, DropsAGaugeAtItsSaturationLimit) {
    const auto decoupler = make_decoupler(table_calibration(GetParam()));
    const Force f{0.3, -0.2, -1.0};
    for (std::size_t k = 0; k < GetParam().size(); ++k) {
        auto reading = reading_of(GetParam(), f);
        reading[k] = 0.5 * reading[k];
        const Estimate estimate = decouple(*decoupler, reading, 0, 1u << k);
        expect_force(estimate, f, 2e-15);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_SATURATED});
    }
}

TEST_P(TableOf, IsFiniteOrBadForEveryPatternOfBrokenNumbers) {
    const auto decoupler = make_decoupler(table_calibration(GetParam()));
    const std::array<double, 7> kinds{0.01, kNaN, kInf, -kInf, 1e308, -1e200, 5e-324};
    std::mt19937 random(20260301);
    for (int i = 0; i < 20000; ++i) {
        std::vector<double> reading;
        for (std::size_t k = 0; k < GetParam().size(); ++k) reading.push_back(kinds[random() % kinds.size()]);
        const Estimate estimate =
            decouple(*decoupler, reading, std::uint32_t(random() & random()), std::uint32_t(random() & random() & random()));
        for (const double component : {estimate.wrench_S[0], estimate.wrench_S[1], estimate.wrench_S[2]})
            ASSERT_EQ(std::isfinite(component), estimate.quality() != TACTILED_BAD);
        if (estimate.quality() == TACTILED_GOOD) {
            for (const double number : reading) ASSERT_LT(std::abs(number), 1e3);
        } else {
            ASSERT_NE(estimate.reasons, 0u);
        }
        for (const std::size_t c : {3u, 4u, 5u}) ASSERT_TRUE(std::isnan(estimate.wrench_S[c]));
    }
}

// Good readings of four or eight gauges have a short path through the code. A domain that contains no reading sends
// each reading through the long path, which reports it and otherwise gives the same result to the last bit.
TEST_P(TableOf, GivesTheSameBitsTheShortWayAndTheLongWay) {
    std::mt19937_64 random(6);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const auto bits = [](const Estimate& e) {
        std::array<std::uint64_t, 13> all{};
        for (std::size_t c = 0; c < 6; ++c) {
            all[c] = std::bit_cast<std::uint64_t>(e.wrench_S[c]);
            all[6 + c] = std::bit_cast<std::uint64_t>(e.sd[c]);
        }
        all[12] = std::bit_cast<std::uint64_t>(e.residual);
        return all;
    };
    int good = 0;
    for (int kind = 0; kind < 24; ++kind) {
        Calibration calibration = table_calibration(GetParam());
        for (double& zero : calibration.zero) zero = 1e-3 * uniform(random);
        calibration.sd_slope = {0.01, 0.02, 0.03};
        calibration.full_scale = {0.25, 0.35, 0.9};
        if (kind % 2 == 1) calibration.sd_slope.clear();
        if (kind % 3 == 1) calibration.sd.clear();
        calibration.nominal = kind % 4 == 1;
        if (kind % 6 == 5) {
            calibration.components = {"fz"};
            calibration.sd = {0.02};
            calibration.sd_slope.clear();
            calibration.full_scale = {0.9};
        }
        calibration.channel_least.assign(GetParam().size(), -1);
        calibration.channel_most.assign(GetParam().size(), 1);
        const auto short_way = make_decoupler(calibration);
        calibration.channel_least.assign(GetParam().size(), 7);
        calibration.channel_most.assign(GetParam().size(), 7);
        const auto long_way = make_decoupler(calibration);
        for (int i = 0; i < 2000; ++i) {
            auto channel = reading_of(GetParam(), {0.3 * uniform(random), 0.3 * uniform(random), uniform(random)});
            for (std::size_t k = 0; k < channel.size(); ++k)
                channel[k] += calibration.zero[k] + (i % 4 == 0 ? 1e-3 : 1e-5) * uniform(random);
            if (i % 5 == 0) channel[std::size_t(i) % channel.size()] = 0;
            const std::uint32_t saturated = i % 7 == 0 ? 2u : 0u;
            const Estimate a = decouple(*short_way, channel, 0, saturated), b = decouple(*long_way, channel, 0, saturated);
            ASSERT_EQ(bits(a), bits(b)) << kind << " " << i;
            ASSERT_EQ(a.reasons | unsigned(TACTILED_OUTSIDE_DOMAIN), b.reasons) << kind << " " << i;
            ASSERT_EQ(a.quality(), a.reasons == 0 ? TACTILED_GOOD : TACTILED_UNCERTAIN) << kind << " " << i;
            good += a.quality() == TACTILED_GOOD;
        }
    }
    EXPECT_GT(good, 2000);
}

// Lee et al. print eq. 2 as R1 - R5; their sign table and physics say that a force along +x stretches R5.
TEST(Table, FollowsTheSignTableNotEquationTwo) {
    const auto decoupler = make_decoupler(table_calibration(inner_gauges()));
    expect_force(decouple(*decoupler, {-0.010847, 0, +0.010847, 0}), {+1, 0, 0}, 1e-15);
    expect_force(decouple(*decoupler, {0, -0.010847, 0, +0.010847}), {0, +1, 0}, 1e-15);
    expect_force(decouple(*decoupler, {0.019366, 0.019366, 0.019366, 0.019366}), {0, 0, -1}, 1e-15);
}

TEST(Table, CombinesBothRingsByTheirGains) {
    const auto decoupler = make_decoupler(table_calibration(all_gauges()));
    // Only the outer pair responds: its share of the least-squares Fx is to^2 / (to^2 + ti^2).
    const double share = 8582.0 * 8582 / (8582.0 * 8582 + 10847.0 * 10847);
    EXPECT_NEAR(decouple(*decoupler, {0, 8582e-6, 0, 0, 0, -8582e-6, 0, 0}).wrench_S[0], share, 1e-14);
}

TEST(Table, SubtractsTheZeroOfEachGauge) {
    Calibration calibration = table_calibration(inner_gauges());
    calibration.zero = {0.0156, -0.001, 0.02, 0.003};
    auto reading = reading_of(inner_gauges(), {0.1, -0.2, -0.5});
    for (std::size_t k = 0; k < 4; ++k) reading[k] += calibration.zero[k];
    expect_force(decouple(*make_decoupler(calibration), reading), {0.1, -0.2, -0.5}, 1e-14);
}

TEST(Table, RestReadsZeroWithoutASign) {
    const Estimate estimate = decouple(*make_decoupler(table_calibration(inner_gauges())), {0, 0, 0, 0});
    EXPECT_FALSE(std::signbit(estimate.wrench_S[2]));
    EXPECT_EQ(estimate.quality(), TACTILED_GOOD);
}

// R5 is open and delivers 0 without any flag. Without redundancy the forces would be (-0.74, -0.2, -0.71) N.
TEST(Table, FindsADeadGaugeByTheParity) {
    auto reading = reading_of(inner_gauges(), {0.3, -0.2, -1.0});
    reading[2] = 0;
    const Estimate estimate = decouple(*make_decoupler(table_calibration(inner_gauges())), reading);
    expect_force(estimate, {0.3, -0.2, -1.0}, 1e-15);
    EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL});
    EXPECT_GT(estimate.residual, 6);
}

// A shear along x alone: R3 R4 R7 R8 read 0 correctly, one of the others because it is dead.
TEST(Table, FindsTheDeadGaugeAmongOthersThatTrulyRead0) {
    const auto decoupler = make_decoupler(table_calibration(all_gauges()));
    auto reading = reading_of(all_gauges(), {0.3, 0, 0});
    for (const std::size_t dead : {0u, 1u, 4u, 5u}) {
        auto with_dead = reading;
        with_dead[dead] = 0;
        const Estimate estimate = decouple(*decoupler, with_dead);
        expect_force(estimate, {0.3, 0, 0}, 1e-15);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL}) << dead;
    }
    reading[0] = reading[4] = 0;  // two dead ones: no single gauge explains it
    EXPECT_EQ(decouple(*decoupler, reading).reasons, std::uint32_t{TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY});
}

TEST(Table, SaysDisagreementAndNoStandardDeviationWhenItCannotTellWhichGaugeIsWrong) {
    auto reading = reading_of(inner_gauges(), {0.3, -0.2, -1.0});
    reading[2] *= 0.6;
    const Estimate estimate = decouple(*make_decoupler(table_calibration(inner_gauges())), reading);
    EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY});
    EXPECT_TRUE(std::isnan(estimate.sd[0]));
}

TEST(Table, OnePercentOfGainErrorIsNoDisagreement) {
    const auto decoupler = make_decoupler(table_calibration(inner_gauges()));
    for (unsigned signs = 0; signs < 16; ++signs)
        for (const double newton : {0.01, 0.1, 1.0, 10.0}) {
            auto reading = reading_of(inner_gauges(), {0.3 * newton, -0.2 * newton, -newton});
            for (std::size_t k = 0; k < 4; ++k) reading[k] *= (signs >> k & 1u) != 0 ? 1.01 : 0.99;
            EXPECT_EQ(decouple(*decoupler, reading).quality(), TACTILED_GOOD) << signs << " " << newton;
        }
}

TEST(Table, NoiseAloneIsNoDisagreement) {
    for (const auto& channels : {inner_gauges(), all_gauges()}) {
        const auto decoupler = make_decoupler(table_calibration(channels));
        std::mt19937_64 random(7);
        std::normal_distribution<double> noise(0, 20e-6);
        double squares = 0;
        const int samples = 200000;
        for (int i = 0; i < samples; ++i) {
            std::vector<double> reading(channels.size());
            for (auto& r : reading) r = noise(random);
            const Estimate estimate = decouple(*decoupler, reading);
            ASSERT_EQ(estimate.quality(), TACTILED_GOOD);
            squares += estimate.residual * estimate.residual;
        }
        EXPECT_NEAR(std::sqrt(squares / samples), 1.0, 0.01);  // the residual is in standard deviations
    }
}

TEST(Table, FewerThanThreeInnerGaugesAreBad) {
    const auto decoupler = make_decoupler(table_calibration(all_gauges()));
    const auto reading = reading_of(all_gauges(), {0.3, -0.2, -1.0});
    EXPECT_EQ(decouple(*decoupler, reading, 1u << 0 | 1u << 2).quality(), TACTILED_BAD);
    const Estimate estimate = decouple(*decoupler, reading, 0, 1u << 2 | 1u << 4);
    EXPECT_EQ(estimate.quality(), TACTILED_BAD);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_SATURATED});
    EXPECT_TRUE(std::isnan(estimate.wrench_S[0]));
    EXPECT_EQ(decouple(*decoupler, reading, 0b10101010u).quality(), TACTILED_UNCERTAIN);  // all outer ones
}

TEST_P(TableOf, IsBadForAnotherNumberOfChannels) {
    const auto decoupler = make_decoupler(table_calibration(GetParam()));
    for (std::size_t n = 0; n < 10; ++n) {
        if (n == GetParam().size()) continue;
        const Estimate estimate = decouple(*decoupler, std::vector<double>(n, 0.0));
        EXPECT_EQ(estimate.quality(), TACTILED_BAD) << n;
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_WRONG_DEVICE}) << n;
        EXPECT_TRUE(std::isnan(estimate.wrench_S[2])) << n;
    }
}

TEST_P(TableOf, TheStandardDeviationGrowsWithTheForce) {
    Calibration calibration = table_calibration(GetParam());
    calibration.sd_slope = {0.01, 0.02, 0.03};
    const Estimate estimate = decouple(*make_decoupler(calibration), reading_of(GetParam(), {0.3, -0.2, -1}));
    EXPECT_NEAR(estimate.sd[0], std::hypot(0.01, 0.01 * 0.3), 1e-12);  // N
    EXPECT_NEAR(estimate.sd[1], std::hypot(0.01, 0.02 * 0.2), 1e-12);
    EXPECT_NEAR(estimate.sd[2], std::hypot(0.02, 0.03 * 1), 1e-12);
    // The load is relative to the greatest full scale.
    calibration.full_scale = {0.5, 0.5, 2};
    calibration.sd_load = {0.1, 0, 0.2};
    const Estimate loaded = decouple(*make_decoupler(calibration), reading_of(GetParam(), {0.3, -0.2, -1}));
    const double load = std::hypot(0.3, 0.2, 1) / 2;
    EXPECT_NEAR(loaded.sd[0], std::hypot(0.01, 0.01 * 0.3, 0.1 * load), 1e-12);
    EXPECT_NEAR(loaded.sd[1], estimate.sd[1], 1e-12);
    EXPECT_NEAR(loaded.sd[2], std::hypot(0.02, 0.03 * 1, 0.2 * load), 1e-12);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(loaded.sd[i], stated_sd(calibration, i, loaded.wrench_S), 1e-12);
    Problems problems;
    EXPECT_EQ(parse_calibration(calibration_text(calibration), "c.toml", problems).sd_load, calibration.sd_load);
    calibration.sd_load = {0.1};
    EXPECT_NE(refusal(calibration).find("sd_load has 1 numbers for 3"), std::string::npos);
}

TEST(Table, FlagsForcesBeyondFullScale) {
    Calibration calibration = table_calibration(inner_gauges());
    calibration.full_scale = {0.5, 0.5, 1.0};
    const auto decoupler = make_decoupler(calibration);
    EXPECT_EQ(decouple(*decoupler, reading_of(inner_gauges(), {0.5, 0, -1.04})).reasons, 0u);
    EXPECT_EQ(decouple(*decoupler, reading_of(inner_gauges(), {0, 0, -1.06})).reasons,
              std::uint32_t{TACTILED_OUTSIDE_DOMAIN});
    EXPECT_EQ(decouple(*decoupler, reading_of(inner_gauges(), {0, -0.6, 0})).reasons,
              std::uint32_t{TACTILED_OUTSIDE_DOMAIN});
}

TEST(Table, RefusesCalibrationsThatItCannotUse) {
    Calibration calibration = table_calibration({"R1", "R3", "R5"});
    EXPECT_NE(refusal(calibration).find("lacks R7"), std::string::npos);
    calibration = table_calibration({"R1", "R3", "R5", "R7", "R7"});
    EXPECT_NE(refusal(calibration).find("\"R7\" twice"), std::string::npos);
    calibration = table_calibration({"R1", "R3", "R5", "R9"});
    EXPECT_NE(refusal(calibration).find("\"R9\""), std::string::npos);
    calibration = table_calibration(inner_gauges());
    calibration.parameters["normal_iner"] = 1;
    EXPECT_NE(refusal(calibration).find("did you mean normal_inner?"), std::string::npos);
    calibration = table_calibration(all_gauges());
    calibration.parameters.erase("tangential_outer");
    EXPECT_NE(refusal(calibration).find("tangential_outer"), std::string::npos);
    calibration = table_calibration(inner_gauges());
    calibration.parameters["normal_inner"] = 0;
    EXPECT_NE(refusal(calibration).find("parameter normal_inner"), std::string::npos);
    calibration.parameters["normal_inner"] = 1e-300;  // its square underflows: no number is valid
    EXPECT_NE(refusal(calibration).find("do not determine the three forces"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
