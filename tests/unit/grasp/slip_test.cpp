// Near the friction limit, and beyond it.
#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

TEST(GraspSlip, IsFoundWithinTenMillisecondsAndAnnouncedBefore) {
    Hand hand;
    hand.close().go(0.3, 2, 0.8).stay(0.3);  // friction 0.6: at 1.2 N it slips
    EXPECT_EQ(hand.now().slip_state[0], TACTILED_SLIP_NONE);
    hand.go(0.3, 2, 1.19);
    EXPECT_EQ(hand.now().slip_state[0], TACTILED_SLIP_INCIPIENT);
    EXPECT_NEAR(hand.now().friction_use[0], 0.99, 0.02);
    hand.go(0.005, 2, 1.0).stay(0.005);  // kinetic friction 0.5
    EXPECT_EQ(hand.now().slip_state[0], TACTILED_SLIP_GROSS);
    EXPECT_EQ(hand.now().state, TACTILED_GRIP_SLIPPING);
    EXPECT_EQ(hand.now().slip_mask, 3u);
    EXPECT_NEAR(hand.now().friction, 0.595, 0.02);
    EXPECT_GT(hand.now().friction_sd, 0);
}

TEST(GraspSlip, IsFoundAfterALongHoldAtAnyRate) {
    for (const double rate_hz : {1000, 2000, 8000})
        for (const double part : {0.19, 0.23}) {
            Hand hand;
            hand.rate_hz = rate_hz;
            hand.close().go(0.3, 2, 0.8).stay(2).go(0.3, 2, 1.17);
            ASSERT_EQ(hand.now().state, TACTILED_GRIP_HOLDING);
            hand.go(0.005, 2, 1.17 * (1 - part)).stay(0.003);
            EXPECT_EQ(hand.now().slips, 2u) << rate_hz << " Hz, " << part;
        }
}

TEST(GraspSlip, IsFoundAtTheLimitHoweverSlowlyItGivesWay) {
    for (const double fall_s : {0.005, 0.012, 0.03}) {
        Hand hand;
        hand.close().go(0.3, 2, 0.8).stay(2).go(0.3, 2, 1.17).go(fall_s, 2, 0.8 * 1.17).stay(0.01);
        EXPECT_EQ(hand.now().slips, 2u) << fall_s;
    }
}

TEST(GraspSlip, EachIsCountedOnceAndStaysLatched) {
    Hand hand;
    hand.close().go(0.3, 2, 1.15);
    for (int i = 0; i < 3; ++i) hand.go(0.005, 2, 0.95).stay(0.2).go(0.1, 2, 1.15);
    EXPECT_EQ(hand.now().slip_count[0], 3u);
    EXPECT_EQ(hand.now().slips, 6u);  // both jaws
    hand.go(0.3, 3, 1.0).stay(0.3);
    EXPECT_EQ(hand.now().slip_mask, 0u);
    EXPECT_EQ(hand.now().slip_latch, 3u);
    hand.grasp.clear_slips(1);
    EXPECT_EQ(hand.now().slip_latch, 2u);
}

TEST(GraspSlip, ATighterGripIsNone) {
    Hand hand;
    hand.close().go(0.3, 2, 1.0).stay(0.2).go(0.01, 4, 1.0).stay(0.2);
    EXPECT_EQ(hand.now().slips, 0u);
}

TEST(GraspSlip, NoiseWithoutContactIsNone) {  // a ratio of two numbers near 0
    Hand hand;
    hand.noise_N = 0.05;
    hand.go(5, 0, 0);
    EXPECT_EQ(hand.now().slips, 0u);
    EXPECT_EQ(hand.now().slip_state[0], TACTILED_SLIP_NONE);
    EXPECT_TRUE(std::isnan(hand.now().friction_use[0]));
}

TEST(GraspSlip, WithoutShearItIsUnknown) {
    Hand hand;
    hand.spoil = [](std::size_t, JawSample& s) { s.force_S_N[0] = s.force_S_N[1] = std::nan(""); };
    hand.close();
    EXPECT_EQ(hand.now().slip_state[0], TACTILED_SLIP_UNKNOWN);
    EXPECT_EQ(hand.now().state, TACTILED_GRIP_GRASPED);
}

TEST(GraspSlip, TheLeastGripHoldsTheLoadWithItsMargin) {
    Hand hand;
    hand.close().go(0.2, 2, 0.6).stay(0.5);
    EXPECT_NEAR(hand.now().recommended_grip_N, 1.5 * 0.6 / 0.6, 0.05);
    EXPECT_NEAR(hand.now().grip_N, 2, 0.01);
}

TEST(GraspSlip, AVibrationThatBeginsAtOnceIsNone) {
    for (const double reported : {0.6, 0.0}) {
        for (const double hz : {8.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 50.0, 60.0}) {
            grasp::Setup setup = two_jaws();
            setup.friction = reported;
            Hand hand(setup);
            const double load_N = 0.46 * 2;  // limit 0.6: a margin of 1.3
            hand.close().go(0.15, 2, load_N).stay(0.8);
            for (int i = 1; i <= 500; ++i) hand.go(0.001, 2, load_N * (1 + 0.1 * std::sin(2 * 3.14159265 * hz * i * 1e-3)));
            EXPECT_EQ(hand.now().slips, 0u) << hz << " Hz, friction " << reported;
        }
    }
}

TEST(GraspSlip, AFastPullThatGivesWayBelowTheFrictionThatWasReportedIsOne) {
    Hand hand;
    hand.close().go(0.15, 2, 0.7).stay(0.8).go(0.05, 2, 0.48 * 2);  // 0.48 of the configured 0.6
    ASSERT_EQ(hand.now().slips, 0u);
    hand.go(0.005, 2, 0.8 * 0.48 * 2).stay(0.004);
    EXPECT_EQ(hand.now().slips, 2u);  // one per jaw
}

}  // namespace
}  // namespace tactiled::grasp
