// The effect of a known weight, and its standard deviation: a shear before the lift may be a leak of the press, which
// stays, or a force, which does not.
#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

constexpr double kKnown_kg = 0.2;

// Adds the share `part` of the weight of `of_kg` to the shear along gravity of both jaws, with sensors of the given
// sd.
void put(Hand& hand, double part, double of_kg) {
    hand.spoil = [=](std::size_t, JawSample& s) {
        if (s.force_S_N[2] < -1.9) s.force_S_N[1] -= part * of_kg * kG / 2;  // in the grip only
        s.sd_N = {0.002, 0.002, 0.002};
    };
}

void release(Hand& hand) { hand.go(0.2, 2, 0).go(0.2, 0, 0); }

double error_kg(Hand& hand, double mass_kg) {
    release(hand);
    hand.close().lift(mass_kg);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    return hand.now().weight_kg - mass_kg;
}

TEST(KnownWeight, ALeakThatIsAlwaysThereIsInTheStandardDeviationOfOtherWeights) {
    for (const double scale : {1.0, 0.5}) {
        Hand hand(hairs());
        put(hand, 0.008, kKnown_kg);
        hand.close().lift(kKnown_kg);
        ASSERT_TRUE(hand.grasp.known_weight(scale * kKnown_kg));
        const double error = error_kg(hand, 0.04) + (1 - scale) * 0.04;
        EXPECT_NEAR(error, scale * 0.8 * 0.008 * kKnown_kg, 0.0001);
        EXPECT_GT(hand.now().weight_sd_kg, error);
        EXPECT_LT(hand.now().weight_sd_kg, 1.5 * error);
    }
}

TEST(KnownWeight, AForceThatWasThereOnlyThenIsInTheStandardDeviationOfOtherWeights) {
    Hand hand(hairs());
    put(hand, 0.04, kKnown_kg);
    hand.close().lift(kKnown_kg);
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    put(hand, 0, 0);
    const double error = error_kg(hand, 0.04);
    EXPECT_NEAR(error, -0.04 * 0.04 / 1.04, 0.0002);
    EXPECT_GT(hand.now().weight_sd_kg, -0.9 * error);
}

TEST(KnownWeight, OfItsOwnSizeALeakIsInTheScale) {
    Hand hand(hairs());
    put(hand, 0, 0);
    hand.close().lift(kKnown_kg);
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    (void)error_kg(hand, kKnown_kg);
    const double without_kg = hand.now().weight_sd_kg;
    ASSERT_TRUE(hand.grasp.known_weight(0));
    put(hand, 0.008, kKnown_kg);
    (void)error_kg(hand, kKnown_kg);
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    EXPECT_NEAR(error_kg(hand, kKnown_kg), 0, 0.0003);
    EXPECT_NEAR(hand.now().weight_sd_kg, without_kg, 0.1 * without_kg);
}

TEST(KnownWeight, AForceOnTheTableIsNoWeightButInTheStandardDeviation) {
    Hand hand(hairs());
    put(hand, 0, 0);
    hand.close().lift(kKnown_kg);
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    (void)error_kg(hand, 0.1);
    const double without_kg = hand.now().weight_sd_kg;
    release(hand);
    hand.go(0.5, 0, 0).go(0.2, 2, 0.005).stay(0.3).go(0.15, 2, 0.1 * kG / 2).stay(0.4);  // 1 g before, 100 g after
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.1, 0.0003);
    EXPECT_NEAR(hand.now().weight_sd_kg, std::hypot(without_kg, 0.001), 0.0001);
}

TEST(KnownWeight, NoForceMakesTheStandardDeviationLargerThanALeakCanBe) {
    Hand hand(hairs());
    put(hand, 0, 0);
    hand.close().lift(kKnown_kg);
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    release(hand);
    hand.go(0.5, 0, 0).go(0.2, 2, 0.3).stay(0.3).go(0.15, 2, 0.1 * kG / 2).stay(0.4);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.1, 0.0005);
    EXPECT_NEAR(hand.now().weight_sd_kg, 0.03 * 2 * 2 / kG, 0.0002);  // 3 % of 2 N a jaw
}

TEST(KnownWeight, IsRefusedWhereAForceWasThereBeforeTheLift) {
    Hand hand(hairs());
    put(hand, 0.06, kKnown_kg);
    hand.close().lift(kKnown_kg);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_FALSE(hand.grasp.known_weight(kKnown_kg));
    EXPECT_NEAR(hand.now().weight_kg, 1.06 * kKnown_kg, 0.001);
}

TEST(KnownWeight, UnderAForceTheStandardDeviationHasWhatTheScaleTookOfALeak) {
    Hand hand(hairs());
    put(hand, 0.04, kKnown_kg);
    hand.close().lift(kKnown_kg);
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    put(hand, 0, 0);
    release(hand);
    hand.go(0.5, 0, 0).go(0.1, 0.2, 0).go(0.1, 0.7, 0.2).stay(0.4).go(0.15, 0.7, kKnown_kg * kG / 2).stay(0.4);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    const double error = hand.now().weight_kg - kKnown_kg;
    EXPECT_NEAR(error, -0.04 / 1.04 * kKnown_kg, 0.0005);
    EXPECT_GT(hand.now().weight_sd_kg, -error);
}

TEST(KnownWeight, IsRefusedUnderATareAndInTheInstantInWhichGravityTurns) {
    Hand hand(hairs());
    put(hand, 0, 0);
    hand.close().lift(kKnown_kg);
    hand.grasp.gravity({0, kG, 0});
    EXPECT_FALSE(hand.grasp.known_weight(kKnown_kg));
    EXPECT_FALSE(hand.grasp.zero_weight());
    hand.grasp.gravity({0, 0, kG});
    hand.stay(0.5);
    ASSERT_TRUE(hand.grasp.zero_weight());
    hand.go(0.05, 2, 2 * kKnown_kg * kG / 2).stay(0.5);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, kKnown_kg, 0.001);
    EXPECT_FALSE(hand.grasp.known_weight(kKnown_kg));
}

TEST(KnownWeight, NeedsOnlyTheComponentThatCarries) {
    Hand hand(hairs());
    hand.spoil = [](std::size_t, JawSample& s) { s.force_S_N[0] = std::nan(""); };
    hand.close();
    ASSERT_TRUE(hand.grasp.start_weighing());
    hand.lift(kKnown_kg);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_TRUE(hand.grasp.known_weight(kKnown_kg));
}

TEST(KnownWeight, SaysNothingOfOtherJawsThanCarriedIt) {
    grasp::Setup setup = hairs();
    setup.jaws[1].S_from_G = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // gravity points into its skin
    Hand hand(setup);
    put(hand, 0, 0);
    hand.close().lift(kKnown_kg);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    release(hand);
    hand.grasp.gravity({0, -kG, 0});  // along x of the first skin, against y of the second
    hand.spoil = [](std::size_t j, JawSample& s) {
        s.force_S_N[j == 0 ? 1 : 0] = 0;
        s.sd_N = {0.002, 0.002, 0.002};
    };
    hand.close().go(0.15, 2, kKnown_kg * kG / 2, kKnown_kg * kG / 2).stay(0.4);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_GT(hand.now().weight_sd_kg, 0.09 * kKnown_kg);
}

TEST(KnownWeight, AForceThenIsNoLeakNow) {
    Hand hand(hairs());
    put(hand, 0, 0);
    hand.go(0.5, 0, 0).go(0.1, 0.2, 0).go(0.1, 0.7, 0.04).stay(0.4).go(0.15, 0.7, kKnown_kg * kG / 2).stay(0.4);
    // 8 g were on the jaws, 5.6 % of the press, and disappeared with the lift
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    hand.spoil = [](std::size_t, JawSample& s) {
        if (s.force_S_N[2] < -0.5) s.force_S_N[1] -= 0.02;
        s.sd_N = {0.002, 0.002, 0.002};
    };
    release(hand);
    hand.go(0.5, 0, 0).go(0.2, 0.7, 0).stay(0.4).go(0.15, 0.7, 0.1 * kG / 2).stay(0.4);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.104, 0.0005);
    EXPECT_GT(hand.now().weight_sd_kg, 0.004);
}

TEST(KnownWeight, WhatItScatteredByIsInEveryWeightAfterIt) {
    Hand hand(hairs());
    put(hand, 0, 0);
    hand.go(0.5, 0, 0).go(0.2, 2, 0).stay(0.3);
    hand.noise_N = 0.05;
    hand.lift(kKnown_kg);
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    hand.noise_N = 0.001;
    (void)error_kg(hand, kKnown_kg);
    const double after_kg = hand.now().weight_sd_kg;
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    (void)error_kg(hand, kKnown_kg);
    EXPECT_GT(after_kg, 1.5 * hand.now().weight_sd_kg);
}

TEST(KnownWeight, GravitysDirectionThenIsInEveryWeightAfterIt) {
    Hand hand(hairs());
    put(hand, 0, 0);
    const double lean = 60 * M_PI / 180;
    hand.grasp.gravity({kG * std::sin(lean), 0, kG * std::cos(lean)});
    hand.spoil = [&](std::size_t j, JawSample& s) {  // the weight is on the lower jaw
        s.force_S_N[2] -= (j == 0 ? 1 : -1) * s.force_S_N[1] * std::tan(lean);
        s.sd_N = {0.002, 0.002, 0.002};
    };
    hand.close().go(0.15, 2, 0.1 * kG * std::cos(lean)).stay(0.4);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    hand.grasp.gravity({0, 0, kG});
    put(hand, 0, 0);
    (void)error_kg(hand, 0.2);
    EXPECT_GT(hand.now().weight_sd_kg, 0.01 * std::tan(lean) * 0.2);
}

TEST(KnownWeight, OfALightOneTheErrorGrowsWithTheLoad) {
    Hand hand(hairs());
    hand.spoil = [](std::size_t, JawSample& s) { s.sd_N = {0.002, 0.002, 0.002}; };
    hand.close().lift(0.05);
    const double then_kg = hand.now().weight_sd_kg;
    ASSERT_TRUE(hand.grasp.known_weight(0.05));
    (void)error_kg(hand, 0.2);
    EXPECT_GT(hand.now().weight_sd_kg, 2.5 * then_kg);
}

// 5 mN that appear with a load of any size: not an error of a gain, and within one standard deviation of each sensor.
TEST(KnownWeight, OfOtherSensorsItLeavesHalfOfTheStandardDeviation) {
    Hand hand;
    hand.spoil = [](std::size_t, JawSample& s) {
        s.sd_N = {0.005, 0.005, 0.005};
        s.force_S_N[1] -= 0.005 * std::tanh(-s.force_S_N[1] / 0.03);
    };
    hand.close().lift(0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    EXPECT_GT(error_kg(hand, 0.02), 0.0008);
    EXPECT_GT(hand.now().weight_sd_kg, 0.0008);
    release(hand);
    ASSERT_TRUE(hand.grasp.known_weight(0));
    hand.close().lift(0.03);
    ASSERT_TRUE(hand.grasp.known_weight(0.03));
    const double error = error_kg(hand, 0.2);
    EXPECT_GT(hand.now().weight_sd_kg, -0.9 * error);
}

TEST(KnownWeight, ForgottenTheStandardDeviationIsAsBefore) {
    Hand hand(hairs());
    put(hand, 0, 0);
    hand.close().lift(kKnown_kg);
    const double before_kg = hand.now().weight_sd_kg;
    ASSERT_TRUE(hand.grasp.known_weight(0.9 * kKnown_kg));
    ASSERT_TRUE(hand.grasp.known_weight(0));
    EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    hand.stay(0.1);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_sd_kg, before_kg, 0.2 * before_kg);
}

TEST(KnownWeight, ItsGraspWasSharedNoBetterThanThisOne) {
    grasp::Setup setup = two_jaws();
    setup.jaws_of_gripper = 4;
    setup.share_sd = 0.05;
    Hand hand(setup);
    hand.spoil = [](std::size_t, JawSample& s) { s.sd_N = {1e-4, 1e-4, 1e-4}; };
    hand.close().lift(kKnown_kg);
    ASSERT_TRUE(hand.grasp.known_weight(kKnown_kg));
    (void)error_kg(hand, kKnown_kg);
    // With two jaws of four, each with 1 + e of its share, 5 %: the mean of two e minus that of four, here and then.
    EXPECT_NEAR(hand.now().weight_sd_kg / kKnown_kg, 0.05 * std::sqrt(2 * (1.0 / 2 - 1.0 / 4)), 0.002);
}

}  // namespace
}  // namespace tactiled::grasp
