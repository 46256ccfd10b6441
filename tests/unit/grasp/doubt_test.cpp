// A weight must not seem good if the load, the zero, a command or the sensor has changed.
#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

constexpr double kLoad_N = 0.2 * kG / 2;  // on one jaw, at 200 g

grasp::Setup window_of(double ms) {
    grasp::Setup s = two_jaws();
    s.weigh_window_ms = ms;
    return s;
}

TEST(GraspDoubt, AWeightIsNotStableOnceItsLoadChanged) {
    for (const double window_ms : {100, 1000}) {
        Hand hand(window_of(window_ms));
        hand.close().lift(0.2).stay(2);
        ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
        hand.go(0.002, 2, kLoad_N / 2).stay(0.02);
        EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_STABLE) << window_ms;
    }
}

TEST(GraspDoubt, ALoadThatJumpsAboutIsNeverStable) {
    Hand hand;
    hand.close().lift(0.2).stay(0.5).go(0.002, 2, 1.4 * kLoad_N).stay(0.06);
    hand.each = [](const tactiled_grasp& g) { EXPECT_NE(g.weight_state, TACTILED_WEIGHT_STABLE); };
    for (int i = 0; i < 20; ++i) hand.go(0.002, 2, 0.7 * kLoad_N).stay(0.058).go(0.002, 2, 1.4 * kLoad_N).stay(0.058);
}

TEST(GraspDoubt, ALongWaitAndALongWindowStillEndInAWeight) {
    grasp::Setup setup = window_of(600);
    setup.lift_accelerates_ms = 1000;
    Hand hand(setup);
    hand.close().lift(0.2).stay(2);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
}

TEST(GraspDoubt, AKnownWeightMustBeWeighedWellEnough) {
    Hand hand;
    hand.spoil = [](std::size_t, JawSample& s) { s.sd_N = {0.05, 0.05, 0.05}; };
    hand.close().lift(0.1);
    EXPECT_FALSE(hand.grasp.known_weight(0.1));
}

TEST(GraspDoubt, AKnownWeightOfZeroForgetsTheScale) {
    Hand hand;
    hand.close().lift(0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0.1));
    hand.stay(0.1);
    EXPECT_NEAR(hand.now().weight_kg, 0.1, 0.001);
    ASSERT_TRUE(hand.grasp.known_weight(0));
    hand.stay(0.1);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.002);
}

TEST(GraspDoubt, AReportedAccelerationCountsAlongEachSkin) {
    const double tilt = 25 * M_PI / 180, sideways_m_s2 = 3;
    grasp::Setup setup = two_jaws();
    setup.gravity_G = {kG * std::sin(tilt), 0, kG * std::cos(tilt)};
    Hand hand(setup);
    const Vector a{sideways_m_s2 * std::cos(tilt), 0, -sideways_m_s2 * std::sin(tilt)};  // perpendicular to gravity
    hand.close();
    hand.each = [&](const tactiled_grasp&) { hand.grasp.acceleration(a, std::uint64_t(hand.t_s() * 1e9)); };
    hand.go(0.05, 2, 0.1 * (setup.gravity_G[2] - a[2])).stay(0.5);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.001);
    EXPECT_GT(hand.now().weight_sd_kg, 0.002);  // 5 % of 3 m/s^2
}

TEST(GraspDoubt, ATareWhileHoldingIsNoFreePhase) {
    Hand hand;
    hand.close().lift(0.2);
    hand.spoil = [](std::size_t, JawSample& s) { s.quality = TACTILED_BAD; };
    hand.stay(0.001);
    hand.spoil = [](std::size_t, JawSample& s) { s.force_S_N[1] += kLoad_N, s.force_S_N[2] += 2; };
    hand.stay(1.1).go(0.2, 2, 0).go(0.2, 0, 0);
    hand.each = [](const tactiled_grasp& g) {
        const bool stable = g.weight_state == TACTILED_WEIGHT_STABLE;
        EXPECT_NEAR(stable ? g.weight_kg : 0.2, 0.2, 0.01);
    };
    hand.close().lift(0.2).stay(0.5);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
}

TEST(GraspDoubt, ADiscontinuityUnderALightGripIsNoFreePhase) {
    Hand hand;
    hand.go(0.5, 0, 0).go(0.2, 0.6, 0).go(0.1, 0.4, 0).go(0.1, 0.4, 0.2).stay(0.3);
    hand.spoil = [](std::size_t, JawSample& s) { s.quality = TACTILED_BAD; };
    hand.stay(0.001);
    hand.spoil = nullptr;
    hand.stay(0.5);
    hand.each = [](const tactiled_grasp& g) {
        const bool stable = g.weight_state == TACTILED_WEIGHT_STABLE;
        EXPECT_NEAR(stable ? g.weight_kg : 0.2, 0.2, 0.01);
    };
    hand.go(0.1, 2, 0.2).stay(0.2).go(0.15, 2, kLoad_N).stay(0.5);
}

TEST(GraspDoubt, AJawThatDoesNotSeeTheShearLeavesNoWeight) {
    Hand hand;
    hand.close().lift(0.2);
    hand.spoil = [](std::size_t j, JawSample& s) {
        if (j == 1) s.force_S_N[1] = std::nan("");
    };
    hand.stay(0.02);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_NOT_OBSERVABLE);
    EXPECT_TRUE(std::isnan(hand.now().weight_kg));
}

TEST(GraspDoubt, AComponentThatCarriesNothingMayBeUnseen) {
    Hand hand;
    hand.spoil = [](std::size_t, JawSample& s) { s.force_S_N[0] = std::nan(""); };
    hand.close();
    ASSERT_TRUE(hand.grasp.start_weighing());  // without both components no lift is detected
    hand.go(0.15, 2, kLoad_N).stay(0.5);
    EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_NOT_OBSERVABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.002);
}

TEST(GraspDoubt, AJawThatFellSilentLeavesNoWeight) {
    Hand hand;
    hand.close().lift(0.2);
    const double silent_s = hand.t_s();
    hand.spoil = [&](std::size_t j, JawSample& s) {
        if (j == 1) s.t_ns = std::uint64_t(silent_s * 1e9);  // no newer value, and no BAD sample
    };
    hand.stay(0.6);
    EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_TRUE(std::isnan(hand.now().weight_kg));
}

TEST(GraspDoubt, OneSampleBeyondTheScaleIsAnOverload) {
    for (int at = 0; at < 5; ++at) {
        grasp::Setup setup = two_jaws();
        setup.jaws[0].full_scale_N[2] = 5;
        Hand hand(setup);
        hand.close().lift(0.2).stay(0.001 * at);
        bool seen = false;
        hand.each = [&](const tactiled_grasp& g) { seen |= g.weight_state == TACTILED_WEIGHT_OVERLOAD; };
        hand.go(0.001, 6, kLoad_N).go(0.001, 2, kLoad_N).stay(0.008);
        EXPECT_TRUE(seen) << at;
    }
}

TEST(GraspDoubt, ATareEndsWithTheGrasp) {
    Hand hand;
    hand.close().lift(0.2);
    ASSERT_TRUE(hand.grasp.zero_weight());
    hand.go(0.2, 2, 0).go(0.2, 0, 0).stay(0.2).close().lift(0.2);
    EXPECT_NEAR(hand.now().weight_kg, 0.2, 0.002);
}

TEST(GraspDoubt, ATareIsNotDroppedBlindly) {
    Hand dead;
    dead.close().lift(0.2);
    ASSERT_TRUE(dead.grasp.zero_weight());
    dead.spoil = [](std::size_t, JawSample& s) { s.quality = TACTILED_BAD; };
    dead.stay(0.01);
    EXPECT_FALSE(dead.grasp.zero_weight());
    Hand stopped;
    stopped.close().lift(0.2);
    ASSERT_TRUE(stopped.grasp.stop_weighing());
    EXPECT_FALSE(stopped.grasp.zero_weight());
    EXPECT_TRUE(Hand().go(0.2, 0, 0).grasp.zero_weight());
}

TEST(GraspDoubt, AnUnsureWeightRecognisesNothing) {
    Hand hand;
    const Object taught[] = {{1, "egg", 0.057, 0.0005}};
    hand.grasp.objects(taught);
    hand.spoil = [](std::size_t, JawSample& s) { s.sd_N = {0.05, 0.05, 0.05}; };  // 9 g
    hand.close().lift(0.057);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    hand.spoil = [](std::size_t, JawSample& s) { s.sd_N = {0.5, 0.5, 0.5}; };
    hand.stay(0.05);
    EXPECT_EQ(hand.now().object_id, 0u);
    EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_STABLE);  // more than a fifth of it
}

TEST(GraspDoubt, WithoutGravityNoWeightIsLeftFromBefore) {
    Hand hand;
    hand.close().lift(0.2);
    hand.grasp.gravity({std::nan(""), 0, 0});
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_NOT_OBSERVABLE);
    EXPECT_TRUE(std::isnan(hand.now().weight_kg));
    EXPECT_TRUE(std::isnan(hand.now().weight_sd_kg));
}

}  // namespace
}  // namespace tactiled::grasp
