// The state of the gripper from its forces alone.
#include <vector>

#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

std::vector<std::uint32_t> states(Hand& hand, const std::function<void()>& acts) {
    std::vector<std::uint32_t> seen{hand.now().state};
    hand.each = [&](const tactiled_grasp& g) {
        if (g.state != seen.back()) seen.push_back(g.state);
    };
    acts();
    return seen;
}

TEST(GraspPhase, IsUnknownBeforeTheFirstSample) { EXPECT_EQ(Hand().now().state, TACTILED_GRIP_UNKNOWN); }

TEST(GraspPhase, GoesThroughAWholeGraspWithoutAnyHint) {
    Hand hand;
    hand.go(0.5, 0, 0);
    const auto seen = states(
        hand, [&] { hand.go(0.2, 2, 0).stay(0.2).lift(0.1).stay(0.3).go(0.2, 2, 0).stay(0.1).go(0.2, 0, 0).stay(0.2); });
    EXPECT_EQ(seen, (std::vector<std::uint32_t>{TACTILED_GRIP_OPEN, TACTILED_GRIP_CONTACT, TACTILED_GRIP_GRASPED,
                                                TACTILED_GRIP_LIFTING, TACTILED_GRIP_HOLDING, TACTILED_GRIP_GRASPED,
                                                TACTILED_GRIP_OPEN}));
}

TEST(GraspPhase, ContactDoesNotBounceWhileAPressHoversAtTheThreshold) {
    Hand hand;
    hand.noise_N = 0.03;
    hand.go(0.5, 0, 0);
    const auto seen = states(hand, [&] { hand.go(1, 0.5, 0).stay(3); });
    ASSERT_GE(seen.size(), 2u);
    EXPECT_EQ(seen[1], TACTILED_GRIP_CONTACT);
    EXPECT_LE(seen.size(), 3u);  // and grasped
}

TEST(GraspPhase, ContactIsSeenTwoSamplesAfterThePressPassesTheThreshold) {
    Hand hand;
    hand.go(0.5, 0, 0);
    hand.go(0.001, 1, 0);
    EXPECT_EQ(hand.now().state, TACTILED_GRIP_OPEN);  // one sample may be a spike
    hand.stay(0.001);
    EXPECT_EQ(hand.now().state, TACTILED_GRIP_CONTACT);
}

TEST(GraspPhase, WhatFallsOutIsLostAndWhatIsPutDownIsNot) {
    Hand falls;
    falls.close().lift(0.1).go(0.002, 0, 0).stay(0.1);
    EXPECT_EQ(falls.now().state, TACTILED_GRIP_LOST);
    Hand opens;
    opens.close().lift(0.1).go(0.2, 0, 0).stay(0.1);  // in the air, but as slowly as jaws open
    EXPECT_EQ(opens.now().state, TACTILED_GRIP_OPEN);
}

TEST(GraspPhase, AHintDecidesWhereForcesCannot) {
    Hand reported;
    reported.close().lift(0.1);
    reported.grasp.hint(Hint::opening);
    reported.go(0.002, 0, 0).stay(0.1);
    EXPECT_EQ(reported.now().state, TACTILED_GRIP_OPEN);
    Hand moving;
    moving.close().lift(0.1);
    moving.grasp.hint(Hint::moving);
    moving.go(0.2, 0, 0).stay(0.1);
    EXPECT_EQ(moving.now().state, TACTILED_GRIP_LOST);
}

TEST(GraspPhase, TwoGraspsWithinATenthOfASecondAreTwo) {
    Hand hand;
    hand.close().lift(0.1).go(0.02, 0, 0).stay(0.03).go(0.02, 2, 0).stay(0.2);
    EXPECT_EQ(hand.now().grasps, 2u);
    hand.lift(0.1);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.1, 0.001);
}

TEST(GraspPhase, ASensorThatDiesWhileHoldingTakesStateAndWeightWithIt) {
    Hand hand;
    hand.close().lift(0.1);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    hand.spoil = [](std::size_t j, JawSample& s) {
        if (j == 1) s.quality = TACTILED_BAD;
    };
    hand.stay(0.002);
    EXPECT_EQ(hand.now().state, TACTILED_GRIP_UNKNOWN);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_NONE);
    EXPECT_TRUE(std::isnan(hand.now().weight_kg));
    hand.spoil = nullptr;  // the sensor returns, with an unknown zero
    hand.stay(1);
    EXPECT_NE(hand.now().state, TACTILED_GRIP_UNKNOWN);
    EXPECT_EQ(hand.now().grasps, 1u);
    EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_TRUE(std::isnan(hand.now().weight_kg));
}

TEST(GraspPhase, AJawThatLosesTouchForAMomentDoesNotEndTheWeighing) {
    Hand hand;
    hand.close().lift(0.2);
    hand.spoil = [](std::size_t j, JawSample& s) {
        if (j == 1) s.force_S_N = {0, 0, 0};
    };
    hand.stay(0.004);
    hand.spoil = nullptr;
    hand.stay(1);
    EXPECT_EQ(hand.now().grasps, 1u);
    EXPECT_EQ(hand.now().state, TACTILED_GRIP_HOLDING);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.002);
    hand.go(0.2, 2, 0).stay(0.3);
    EXPECT_EQ(hand.now().state, TACTILED_GRIP_GRASPED);  // put down
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_NONE);
}

TEST(GraspPhase, ASampleFromTheFutureDoesNotStopTheClock) {
    Hand hand;
    hand.close().lift(0.2);
    hand.spoil = [](std::size_t j, JawSample& s) {
        if (j == 1) s.t_ns += 3'600'000'000'000;
    };
    hand.stay(0.001);
    hand.spoil = nullptr;
    hand.go(0.002, 2, 0.5).stay(0.1);
    EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_LT(double(hand.now().t_ns) * 1e-9, hand.t_s() + 0.1);
}

TEST(GraspPhase, ATimeThatAllJawsJumpToIsTheTime) {
    Hand hand;
    hand.close().lift(0.2);
    hand.spoil = [](std::size_t, JawSample& s) { s.t_ns += 3'600'000'000'000; };
    hand.stay(0.5);
    EXPECT_NEAR(double(hand.now().t_ns) * 1e-9, hand.t_s() + 3600, 0.01);
}

}  // namespace
}  // namespace tactiled::grasp
