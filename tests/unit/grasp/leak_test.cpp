// What a known weight teaches of the leak of a press into the shear, and when it teaches none.
#include "decoupling/grasp/leak.hpp"

#include "tests/unit/grasp/leaking.hpp"

namespace tactiled::grasp {
namespace {

TEST_F(Leaking, WithoutACheckItReadsAsWeight) { EXPECT_NEAR(error_kg(0.6, 0.05), 2 * leak_N(0.6) / kG, 0.0005); }

TEST_F(Leaking, AKnownWeightTakesItOffAtEveryPressBelowItsOwn) {
    take(2, 0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    ASSERT_TRUE(learnt());
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 1e-6);
    EXPECT_EQ(hand.now().scale_shown, 2u);
    for (const double press : {0.7, 1.0, 1.5, 2.0}) {
        release();
        EXPECT_NEAR(error_kg(press, 0.05), 0, 0.0003) << press;  // 0.3 mN a jaw, of 16 to 24
        EXPECT_LT(hand.now().weight_sd_kg, 0.002);
    }
}

TEST_F(Leaking, ItIsAForceOfTheSkinsPlaneAndStaysWhereItWasWhenTheHandTurns) {
    along_x = 0.5;
    take(2, 0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    release();
    const Leak leak = hand.grasp.check().leak[0];
    EXPECT_NEAR(shear_at(leak, 1.0).x(), 0.5 * leak_N(1.0), 0.001);
    EXPECT_NEAR(shear_at(leak, 1.0).y(), -leak_N(1.0), 0.001);
    hand.grasp.gravity({0, kG, 0});  // along x of both skins
    press_N = 1;
    hand.go(0.5, 0, 0).go(0.2, 1, 0).stay(0.2).go(0.15, 1, 0, 0).stay(0.1);
    ASSERT_TRUE(hand.grasp.start_weighing());
    hand.stay(0.5);
    EXPECT_NEAR(hand.now().weight_kg, 0, 0.0003);
}

TEST_F(Leaking, WhatATablePressesOrAHandHoldsIsNone) {
    press_N = 2;
    hand.go(0.5, 0, 0).go(0.2, 2, -0.1).stay(0.3).go(0.15, 2, 0.2 * kG / 2).stay(0.4);  // 5 % of the press
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    EXPECT_FALSE(learnt());
    EXPECT_GT(hand.grasp.check().mass_kg, 0);
}

TEST_F(Leaking, AClampedPhaseThatIsShortOrDriftsOrPullsTeachesTheScaleAlone) {
    const auto shown = [&] {
        hand.stay(0.4);
        EXPECT_TRUE(hand.grasp.known_weight(0.2));
        EXPECT_EQ(hand.grasp.check().mass_kg, 0.2);
        EXPECT_NEAR(hand.now().weight_kg, 0.2, 1e-6);
        EXPECT_EQ(hand.now().scale_shown, learnt() ? 2u : 1u);
        const bool leak = learnt();
        release();
        EXPECT_TRUE(hand.grasp.known_weight(0));
        return leak;
    };
    press_N = 2;
    hand.go(0.5, 0, 0).go(0.2, 2, 0).stay(0.03).go(0.15, 2, 0.2 * kG / 2);
    EXPECT_FALSE(shown());
    hand.go(0.5, 0, 0).go(0.2, 2, 0).go(0.2, 2, 0.02).go(0.15, 2, 0.2 * kG / 2);  // a hand that lifts a little
    EXPECT_FALSE(shown());
    hand.go(0.5, 0, 0).go(0.2, 1.5, 0).stay(0.15).go(0.1, 2, 0).stay(0.06).go(0.15, 2, 0.2 * kG / 2);  // the press moves
    EXPECT_FALSE(shown());
    hand.go(0.5, 0, 0).go(0.2, 2, 0).stay(0.3).go(0.15, 2, 0.2 * kG / 2);
    EXPECT_TRUE(shown());
}

TEST_F(Leaking, AKnownWeightThatShowsNoneForgetsTheOneOfBefore) {
    take(2, 0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    ASSERT_TRUE(learnt());
    release();
    hand.go(0.5, 0, 0).go(0.2, 2, 0).stay(0.03).go(0.15, 2, 0.2 * kG / 2).stay(0.4);
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    EXPECT_FALSE(learnt());
    EXPECT_EQ(hand.now().scale_shown, 1u);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 1e-6);
    press_N = 2;
    release();
    EXPECT_NEAR(error_kg(2, 0.2), 0, 0.0003);
}

TEST_F(Leaking, OfAGraspBeforeABreakNothingIsLearnt) {
    take(2, 0.2);
    const auto spoil = hand.spoil;
    hand.spoil = [](std::size_t j, JawSample& s) { s.quality = j == 1 ? TACTILED_BAD : s.quality; };
    hand.stay(0.05);
    hand.spoil = spoil;
    hand.stay(1);
    EXPECT_FALSE(hand.grasp.known_weight(0.2));  // nothing is weighed either
    EXPECT_FALSE(learnt());
}

TEST_F(Leaking, AJawThatClosedInOneStepIsUnsureBetween) {
    hand.go(0.5, 0, 0).go(0.002, 2, 0).stay(0.4).go(0.15, 2, 0.2 * kG / 2).stay(0.4);
    press_N = 2;
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    ASSERT_TRUE(learnt());
    const Leak leak = hand.grasp.check().leak[0];
    EXPECT_FALSE(leak.followed);
    EXPECT_GT(shape_sd_N(leak, 1), 0.8 * leak_N(2));
    EXPECT_LT(shape_sd_N(leak, 2), 0.1 * leak_N(2));
}

TEST_F(Leaking, ItIsTheLessSureTheFurtherBeyondItsPress) {
    take(2, 0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    const Leak leak = hand.grasp.check().leak[0];
    EXPECT_GT(shape_sd_N(leak, 4), 0.9 * leak_N(2));
    EXPECT_EQ(shear_at(leak, 4), shear_at(leak, 2));
}

TEST_F(Leaking, WhereASensorsForcesAreMadeOtherwiseItIsForgottenAndTheScaleIsAsUnsureAsTheSensors) {
    take(2, 0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    hand.stay(0.1);
    const double sd_kg = hand.now().weight_sd_kg;
    hand.grasp.forget_leak();
    EXPECT_FALSE(learnt());
    EXPECT_EQ(hand.grasp.check().mass_kg, 0.2);
    hand.stay(0.1);
    EXPECT_EQ(hand.now().scale_shown, 1u);
    EXPECT_GT(hand.now().weight_sd_kg, std::max(1.5 * sd_kg, 0.005 * 2 / kG));  // of two sensors at least their sd
}

}  // namespace
}  // namespace tactiled::grasp
