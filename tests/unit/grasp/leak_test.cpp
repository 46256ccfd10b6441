// The leak of a press into the shear: it is part of the weight, and the standard deviation includes it.
#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

// Leak of a press of 2 N, relative to the press: 0.4 %, 0.8 g for two jaws.
void leak(Hand& hand, double part) {
    hand.spoil = [=](std::size_t, JawSample& s) {
        s.force_S_N[1] -= part * std::max(0.0, -s.force_S_N[2]);
        s.sd_N = {0.002, 0.002, 0.002};
    };
}

TEST(Leak, IsInTheStandardDeviationWithoutAKnownWeight) {
    Hand hand;
    leak(hand, 0.004);
    hand.close().lift(0.1);
    EXPECT_NEAR(hand.now().weight_kg - 0.1, 0.0016, 0.0002);
    EXPECT_GT(hand.now().weight_sd_kg, 0.0015);
}

TEST(Leak, OfASlowClosingIsThatOfItsEnd) {
    Hand hand(hairs());
    leak(hand, 0.004);
    hand.go(0.5, 0, 0).go(3, 2, 0).stay(0.2).lift(0.05);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_GT(hand.now().weight_sd_kg, hand.now().weight_kg - 0.05);
}

TEST(Leak, OfAGripThatWasSqueezedHarderIsThatOfTheEnd) {
    Hand hand(hairs());
    leak(hand, 0.03);
    hand.go(0.5, 0, 0).go(0.2, 0.7, 0).stay(0.3).go(0.5, 4, 0).stay(0.3).lift(0.2);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_GT(hand.now().weight_sd_kg, 0.02);
    EXPECT_FALSE(hand.grasp.known_weight(0.2));
}

TEST(Leak, OfWhatWasPutDownAndSqueezedIsThatOfTheEnd) {
    Hand hand(hairs());
    leak(hand, 0.004);
    hand.go(0.5, 0, 0).go(0.2, 0.6, 0).stay(0.3).lift(0.05).go(0.2, 0.6, 0).stay(0.3);
    ASSERT_EQ(hand.now().state, TACTILED_GRIP_GRASPED);
    hand.go(0.3, 4, 0).stay(0.3).go(0.15, 4, 0.05 * kG / 2).stay(0.4);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_GT(hand.now().weight_sd_kg, 0.95 * (hand.now().weight_kg - 0.05));
}

TEST(Leak, AForceThatComesAfterTheGripIsInTheStandardDeviation) {
    Hand hand(hairs());
    leak(hand, 0);
    // 3 g per jaw, 1.5 % of the press, and it stays
    hand.go(0.5, 0, 0).go(0.2, 2, 0).stay(0.3).go(0.05, 2, 0.03).stay(0.4);
    hand.go(0.15, 2, 0.03 + 0.1 * kG / 2).stay(0.4);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.1061, 0.0005);
    EXPECT_GT(hand.now().weight_sd_kg, 0.006);
    EXPECT_FALSE(hand.grasp.known_weight(0.1));
}

TEST(Leak, OfAPressThatGrowsWithTheLiftIsNotHiddenByTheLoad) {
    for (const double part : {-0.028, -0.02, -0.01}) {
        Hand hand(hairs());
        leak(hand, part);
        hand.go(0.5, 0, 0).go(0.2, 1, 0).stay(0.4).go(0.15, 1.5, 0.05 * kG / 2).stay(0.5);
        EXPECT_GT(hand.now().weight_sd_kg, 0.9 * std::abs(hand.now().weight_kg - 0.05)) << part;
    }
}

TEST(Leak, GrowsWhereTheGripIsTightenedWhileItHolds) {
    Hand hand(hairs());
    leak(hand, 0.004);
    hand.go(0.5, 0, 0).go(0.2, 0.7, 0).stay(0.4).go(0.15, 0.7, 0.05 * kG / 2).stay(0.4).go(0.5, 4, 0.05 * kG / 2).stay(2);
    EXPECT_GT(hand.now().weight_sd_kg, 0.9 * (hand.now().weight_kg - 0.05));
}

TEST(Leak, IsLookedAtWhereAGraspBeginsWithASlip) {
    Hand hand(hairs());
    leak(hand, 0);
    hand.close().lift(0.1).go(0.2, 2, 0).go(0.2, 0, 0).stay(0.4);  // a grasp at rest before
    bool slips = false;
    hand.each = [&](const tactiled_grasp& g) { slips |= g.state == TACTILED_GRIP_SLIPPING; };
    hand.go(0.05, 0.5, 0).go(0.1, 2, 0.9).grasp.hint(Hint::closed);
    hand.go(0.004, 2, 0.03).stay(0.5);
    ASSERT_TRUE(slips);
    hand.go(0.15, 2, 0.2 * kG / 2).stay(0.4);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_sd_kg, 0.0061, 0.001);
}

}  // namespace
}  // namespace tactiled::grasp
