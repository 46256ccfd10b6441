#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "made_by_hand.hpp"

namespace tactiled {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// fz and fx from three channels; the third is for fx only.
Calibration two_by_three() {
    Calibration calibration;
    calibration.path = "skin.toml";
    calibration.model = "generic";
    calibration.method = "matrix";
    calibration.channels = {"A", "B", "C"};
    calibration.zero = {1, 2, 3};
    calibration.components = {"fx", "fz"};
    calibration.matrix = {{0.5, 0, 2}, {-1, 0.25, 0}};
    calibration.sd = {0.1, 0.2};
    calibration.channel_least = {0, 0, 0};
    calibration.channel_most = {10, 10, 10};
    return calibration;
}

TEST(Generic, AppliesTheMatrixToTheReadingsLessTheirZero) {
    const auto decoupler = make_decoupler(two_by_three());
    const Estimate estimate = decouple(*decoupler, {3, 6, 4});
    EXPECT_EQ(estimate.quality(), TACTILED_GOOD);
    EXPECT_EQ(estimate.reasons, 0u);
    EXPECT_EQ(estimate.wrench_S[0], 0.5 * 2 + 2 * 1);  // N
    EXPECT_EQ(estimate.wrench_S[2], -1 * 2 + 0.25 * 4);
    EXPECT_EQ(estimate.sd[0], 0.1);
    EXPECT_EQ(estimate.sd[2], 0.2);
}

TEST(Generic, ANominalCalibrationNeverSaysGood) {
    Calibration calibration = two_by_three();
    calibration.nominal = true;
    const Estimate estimate = decouple(*make_decoupler(calibration), {3, 6, 4});
    EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(estimate.reasons, unsigned(TACTILED_UNCALIBRATED));
    EXPECT_EQ(estimate.wrench_S[0], 0.5 * 2 + 2 * 1);  // N
}

TEST(Generic, LeavesUnseenComponentsNaNNotZero) {
    const auto decoupler = make_decoupler(two_by_three());
    const Estimate estimate = decouple(*decoupler, {3, 6, 4});
    for (const std::size_t c : {1u, 3u, 4u, 5u}) {
        EXPECT_TRUE(std::isnan(estimate.wrench_S[c])) << c;
        EXPECT_TRUE(std::isnan(estimate.sd[c])) << c;
    }
    EXPECT_TRUE(std::isnan(estimate.residual));
}

// 1e16 + 1 - 1e16 is 0 from left to right and 1 in any other order: the documented order is part of the contract.
TEST(Generic, SumsFromTheFirstChannelOn) {
    Calibration calibration = two_by_three();
    calibration.components = {"fz"};
    calibration.sd = {0.1};
    calibration.channel_least.clear();
    calibration.channel_most.clear();
    calibration.zero = {0, 0, 0};
    calibration.matrix = {{1e16, 1, -1e16}};
    EXPECT_EQ(decouple(*make_decoupler(calibration), {1, 1, 1}).wrench_S[2], 0.0);
    calibration.matrix = {{1e16, -1e16, 1}};
    EXPECT_EQ(decouple(*make_decoupler(calibration), {1, 1, 1}).wrench_S[2], 1.0);
}

TEST(Generic, IsBadWhenANeededChannelIsMissing) {
    const auto decoupler = make_decoupler(two_by_three());
    for (const Estimate& estimate : {decouple(*decoupler, {3, 6, 4}, 1u << 2), decouple(*decoupler, {3, kNaN, 4})}) {
        EXPECT_EQ(estimate.quality(), TACTILED_BAD);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL});
        for (const double component : estimate.wrench_S) EXPECT_TRUE(std::isnan(component));
        for (const double sd : estimate.sd) EXPECT_TRUE(std::isnan(sd));
    }
}

TEST(Generic, DoesNotCareForAChannelThatNoComponentUses) {
    Calibration calibration = two_by_three();
    calibration.matrix = {{0.5, 0, 2}, {-1, 0, 0}};
    const auto decoupler = make_decoupler(calibration);
    for (const double unused : {kNaN, kInf, -kInf, 1e308, 99.0}) {
        const Estimate estimate = decouple(*decoupler, {3, unused, 4}, std::isnan(unused) ? 2u : 0u, 2u);
        EXPECT_EQ(estimate.quality(), TACTILED_GOOD) << unused;
        EXPECT_EQ(estimate.wrench_S[0], 3.0);
    }
}

TEST(Generic, IsUncertainAndClaimsNoStandardDeviationWhenSaturated) {
    const Estimate estimate = decouple(*make_decoupler(two_by_three()), {3, 6, 4}, 0, 1u << 1);
    EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_SATURATED | TACTILED_UNKNOWN_UNCERTAINTY});
    EXPECT_TRUE(std::isfinite(estimate.wrench_S[2]));
    EXPECT_TRUE(std::isnan(estimate.sd[2]));
}

TEST(Generic, FlagsWhatTheCalibrationNeverSawBeyondFivePercent) {
    const auto decoupler = make_decoupler(two_by_three());
    EXPECT_EQ(decouple(*decoupler, {10.49, 6, 4}).reasons, 0u);
    EXPECT_EQ(decouple(*decoupler, {-0.49, 6, 4}).reasons, 0u);
    EXPECT_EQ(decouple(*decoupler, {10.51, 6, 4}).reasons, std::uint32_t{TACTILED_OUTSIDE_DOMAIN});
    EXPECT_EQ(decouple(*decoupler, {3, 6, -0.51}).quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(decouple(*decoupler, {3, 6, -0.51}).sd[0], 0.1);
}

TEST(Generic, SaysThatItsUncertaintyIsUnknown) {
    Calibration calibration = two_by_three();
    calibration.sd.clear();
    const Estimate estimate = decouple(*make_decoupler(calibration), {3, 6, 4});
    EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_UNKNOWN_UNCERTAINTY});
}

TEST(Generic, IsBadWhenTheResultOverflows) {
    for (const double reading : {1e308, kInf, -kInf}) {
        const Estimate estimate = decouple(*make_decoupler(two_by_three()), {3, 6, reading});
        EXPECT_EQ(estimate.quality(), TACTILED_BAD);
        for (const double component : estimate.wrench_S) EXPECT_TRUE(std::isnan(component));
        EXPECT_NE(estimate.reasons & TACTILED_NOT_FINITE, 0u);
        if (reading == 1e308) break;  // 2e308: the sum itself
    }
    EXPECT_EQ(decouple(*make_decoupler(two_by_three()), {kInf, 6, 4}).quality(), TACTILED_BAD);
    EXPECT_EQ(decouple(*make_decoupler(two_by_three()), {kInf, -kInf, kInf}).quality(), TACTILED_BAD);
}

TEST(Generic, IsBadForAFrameOfAnotherShape) {
    EXPECT_EQ(decouple(*make_decoupler(two_by_three()), {3, 6}).reasons, std::uint32_t{TACTILED_WRONG_DEVICE});
    EXPECT_EQ(decouple(*make_decoupler(two_by_three()), {3, 6, 4, 5}).quality(), TACTILED_BAD);
}

TEST(Generic, RefusesACalibrationThatDoesNotFitItself) {
    Calibration calibration = two_by_three();
    calibration.matrix[1].pop_back();
    EXPECT_NE(refusal(calibration).find("skin.toml: method matrix: a row of matrix has 2 numbers for 3 channels"),
              std::string::npos);
    calibration = two_by_three();
    calibration.components[1] = "fw";
    EXPECT_NE(refusal(calibration).find("components has \"fw\""), std::string::npos);
    calibration = two_by_three();
    calibration.sd = {0.1};
    EXPECT_NE(refusal(calibration).find("sd has 1 numbers for 2 components"), std::string::npos);
    calibration = two_by_three();
    calibration.matrix[0][0] = kNaN;
    EXPECT_NE(refusal(calibration).find("not finite"), std::string::npos);
    calibration = two_by_three();
    calibration.matrix[1] = {0, -0.0, 0};
    EXPECT_NE(refusal(calibration).find("is all 0, no channel responds to it"), std::string::npos);
    calibration = two_by_three();
    calibration.channels.assign(33, "X");
    EXPECT_NE(refusal(calibration).find("33 channels"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
