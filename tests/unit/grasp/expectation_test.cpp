// The expected standard deviation of a weight is the one that a grasp has later.
#include "decoupling/grasp/expectation.hpp"

#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

std::vector<JawAccuracy> accurate(double sd_N) { return {2, JawAccuracy{{sd_N, sd_N, sd_N}, {}}}; }

Setup sensors_to(double full_scale_N) {
    Setup setup = two_jaws();
    for (JawSetup& jaw : setup.jaws)
        for (double& each : jaw.full_scale_N) each = full_scale_N;
    return setup;
}

TEST(ExpectedWeight, IsTheStandardDeviationOfALaterGrasp) {
    for (const double sd_N : {0.005, 0.05}) {
        const auto expected = expected_weights(sensors_to(5), accurate(sd_N));
        ASSERT_EQ(expected.size(), 2u);
        EXPECT_NEAR(expected[0].mass_kg, 0.2, 1e-9);  // half of 2 x 5 N x 0.6 / 1.5 / g = 0.408 kg, rounded down
        EXPECT_NEAR(expected[1].mass_kg, 0.04, 1e-9);
        for (const auto& one : expected) {
            Hand hand(sensors_to(5));
            hand.spoil = [=](std::size_t, JawSample& s) { s.sd_N = {sd_N, sd_N, sd_N}; };
            hand.go(0.5, 0, 0).go(0.2, one.press_N, 0).stay(0.5).lift(one.mass_kg).stay(1);
            if (hand.now().weight_state != TACTILED_WEIGHT_STABLE) {
                EXPECT_TRUE(std::isnan(one.sd_kg)) << one.mass_kg << " kg, " << sd_N << " N";
                continue;
            }
            EXPECT_NEAR(one.sd_kg, hand.now().weight_sd_kg, 0.1 * hand.now().weight_sd_kg) << one.mass_kg << " kg, " << sd_N;
        }
    }
}

TEST(ExpectedWeight, GrowsWithTheErrorOfTheSensorsAndFallsWithAKnownWeight) {
    grasp::Setup one_jaw = sensors_to(5);
    one_jaw.jaws.pop_back();
    one_jaw.jaws_of_gripper = 2;  // the share of the other jaw is not measured
    const auto fine = expected_weights(sensors_to(5), accurate(0.005)),
               coarse = expected_weights(sensors_to(5), accurate(0.05));
    EXPECT_GT(coarse[0].sd_kg, 2 * fine[0].sd_kg);
    const auto half = expected_weights(one_jaw, {accurate(0.005)[0]});
    EXPECT_NEAR(half[0].sd_kg, 0.1 * half[0].mass_kg, 0.01 * half[0].mass_kg);  // the share's 10 %
    EXPECT_LT(half[0].sd_known_kg, 0.3 * half[0].sd_kg);
    EXPECT_EQ(half[0].known_kg, half[0].mass_kg);
}

TEST(ExpectedWeight, IsUnknownForSensorsThatCannotWeigh) {
    for (const auto& one : expected_weights(sensors_to(0), accurate(20))) EXPECT_TRUE(std::isnan(one.sd_kg));
    grasp::Setup up = two_jaws();
    up.gravity_G = {kG, 0, 0};  // into the skins
    EXPECT_TRUE(expected_weights(up, accurate(0.005)).empty() || std::isnan(expected_weights(up, accurate(0.005))[0].sd_kg));
}

}  // namespace
}  // namespace tactiled::grasp
