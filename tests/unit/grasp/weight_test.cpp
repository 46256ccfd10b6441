// The mass on the jaws, and loads that are not a mass.
#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

TEST(GraspWeight, IsTheMassWithinItsStandardDeviation) {
    Hand hand;
    hand.close().lift(0.2);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.0005);
    EXPECT_LT(hand.now().weight_sd_kg, 0.003);
    EXPECT_GT(hand.now().weight_sd_kg, 0.0005);
}

TEST(GraspWeight, AnOffsetOfTheFreePhaseIsNoWeight) {
    Hand hand;
    hand.spoil = [](std::size_t, JawSample& s) { s.force_S_N[1] -= 0.3; };
    hand.close().lift(0.2);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.0005);
}

TEST(GraspWeight, APlateauOfAccelerationIsNotStableBeforeItIsOver) {
    Hand hand;
    hand.close();
    bool heavy = false;
    hand.each = [&](const tactiled_grasp& g) { heavy |= g.weight_state == TACTILED_WEIGHT_STABLE && g.weight_kg > 0.205; };
    const double weight_N = 0.2 * kG / 2;
    hand.go(0.1, 2, 1.2 * weight_N).stay(0.12).go(0.02, 2, weight_N).stay(0.4);  // 2 m/s2 upwards
    EXPECT_FALSE(heavy);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.001);
}

TEST(GraspWeight, AnAccelerationThatIsReportedIsTakenOffAtOnce) {
    Hand hand;
    hand.close();
    const double weight_N = 0.2 * kG / 2;
    hand.each = [&](const tactiled_grasp&) {
        hand.grasp.acceleration({0, 0, -2}, std::uint64_t(hand.t_s() * 1e9));  // up: against z of G
    };
    hand.go(0.05, 2, (1 + 2 / kG) * weight_N).stay(0.14);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.002);
}

TEST(GraspWeight, SlowingDownAfterwardsIsNoOtherWeight) {
    Hand hand;
    hand.close().lift(0.2);
    const double weight_N = 0.2 * kG / 2;
    double min = 1;
    hand.each = [&](const tactiled_grasp& g) { min = std::min(min, g.weight_kg); };
    hand.go(0.03, 2, 0.85 * weight_N).stay(0.09).go(0.03, 2, weight_N).stay(0.3);
    EXPECT_GT(min, 0.198);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
}

TEST(GraspWeight, GravityStraightIntoASkinIsNotObservable) {
    Hand hand;
    hand.grasp.gravity({kG, 0, 0});
    hand.close().lift(0.2);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_NOT_OBSERVABLE);
    EXPECT_TRUE(std::isnan(hand.now().weight_kg));
    hand.grasp.gravity({std::nan(""), 0, 0});
    hand.stay(0.2);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_NOT_OBSERVABLE);
}

TEST(GraspWeight, BeyondFullScaleOrCalibrationThereIsNone) {
    for (const std::uint32_t reason : {TACTILED_SATURATED, TACTILED_OUTSIDE_DOMAIN}) {
        Hand hand;
        hand.close().lift(0.2);
        hand.spoil = [&](std::size_t, JawSample& s) { s.reasons |= reason; };
        hand.stay(0.02);
        EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_OVERLOAD);
        EXPECT_TRUE(std::isnan(hand.now().weight_kg));
    }
}

TEST(GraspWeight, WithoutATemperatureThereIsNoneAndTheStateNamesIt) {
    Hand hand;
    hand.spoil = [](std::size_t, JawSample& s) { s.reasons |= TACTILED_TEMPERATURE; };
    hand.close().lift(0.2);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_TEMPERATURE);
    EXPECT_TRUE(std::isnan(hand.now().weight_kg));
    hand.spoil = [](std::size_t j, JawSample& s) { s.reasons |= j == 0 ? TACTILED_TEMPERATURE : TACTILED_SATURATED; };
    hand.stay(0.02);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_OVERLOAD);
}

TEST(GraspWeight, AReleaseDuringEstimationLeavesNoWeight) {
    Hand hand;
    hand.close().go(0.1, 2, 1).stay(0.05);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_ESTIMATING);
    hand.each = [](const tactiled_grasp& g) { EXPECT_NE(g.weight_state, TACTILED_WEIGHT_STABLE); };
    hand.go(0.1, 0, 0).stay(0.2);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_NONE);
    EXPECT_TRUE(std::isnan(hand.now().weight_kg));
}

TEST(GraspWeight, WhatIsDraggedOverATableIsNeverStable) {
    Hand hand;
    hand.close();
    hand.each = [](const tactiled_grasp& g) { EXPECT_NE(g.weight_state, TACTILED_WEIGHT_STABLE); };
    hand.go(0.1, 2, 0.3, 0.3).stay(1);  // half lifted: the table carries the rest and its friction holds back
}

TEST(GraspWeight, AKnownWeightSetsTheScale) {
    grasp::Setup setup = two_jaws();
    setup.jaws.resize(1);
    setup.jaws_of_gripper = 2;
    Hand hand(setup);
    hand.spoil = [](std::size_t, JawSample& s) { s.force_S_N[1] *= 1.2; };  // it carries 60 %, not half
    hand.close().lift(0.1);
    EXPECT_NEAR(hand.now().weight_kg, 0.12, 0.002);
    EXPECT_NEAR(hand.now().weight_sd_kg / hand.now().weight_kg, 0.1, 0.02);  // the share was not confirmed
    ASSERT_TRUE(hand.grasp.known_weight(0.1));
    hand.go(0.2, 2, 0).go(0.2, 0, 0).close().lift(0.2);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.002);
    EXPECT_LT(hand.now().weight_sd_kg / hand.now().weight_kg, 0.02);
}

TEST(GraspWeight, TareTakesOffWhatHangs) {
    Hand hand;
    EXPECT_FALSE(hand.grasp.known_weight(0.1));
    hand.close().lift(0.1);
    ASSERT_TRUE(hand.grasp.zero_weight());
    EXPECT_NEAR(hand.now().weight_kg, 0, 0.0005);
    hand.go(0.05, 2, 0.15 * kG / 2).stay(1);
    EXPECT_NEAR(hand.now().weight_kg, 0.05, 0.001);
}

TEST(GraspWeight, CommandsStartAndStopIt) {
    Hand hand;
    EXPECT_FALSE(hand.grasp.start_weighing());
    hand.close();
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_NONE);
    ASSERT_TRUE(hand.grasp.start_weighing());
    hand.stay(0.5);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0, 0.001);
    ASSERT_TRUE(hand.grasp.stop_weighing());
    hand.stay(0.1);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_NONE);
}

TEST(GraspObjects, ANewObjectIsUnknownNotTheNearest) {
    Hand hand;
    const Object taught[] = {{1, "egg", 0.057, 0.0005}, {2, "ball", 0.0138, 0.0005}};
    hand.grasp.objects(taught);
    hand.close().lift(0.057);
    EXPECT_EQ(hand.now().object_id, 1u);
    EXPECT_STREQ(hand.now().object, "egg");
    EXPECT_GT(hand.now().object_probability, 0.9F);
    hand.go(0.2, 2, 0).go(0.2, 0, 0).close().lift(0.075);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_EQ(hand.now().object_id, 0u);
    EXPECT_STREQ(hand.now().object, "");
}

TEST(GraspObjects, BetweenTwoOfOneWeightItSaysSo) {
    Hand hand;
    const Object taught[] = {{1, "one", 0.1, 0.001}, {2, "other", 0.1002, 0.001}};
    hand.grasp.objects(taught);
    hand.close().lift(0.1);
    EXPECT_LT(hand.now().object_probability, 0.6F);
}

}  // namespace
}  // namespace tactiled::grasp
