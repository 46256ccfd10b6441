// The first stable weight after an acceleration: the newest part of the window suffices where its beginning still moves,
// and finds the same swings as a whole window.
#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

constexpr double kMass_kg = 0.2, kWeight_N = kMass_kg * kG / 2;  // on one jaw

// Lifts slowly, so that the acceleration ends `late_s` after the time that the configuration allows, and returns how long
// after its end the weight is stable. NaN: not within 1 s.
double stable_after_s(Hand& hand, double late_s, double a_m_s2 = 2) {
    hand.close().go(0.1, 2, 0.9 * kWeight_N);
    const double nine_tenths_s = hand.t_s();
    hand.go(0.02, 2, kWeight_N);
    hand.go(0.05, 2, kWeight_N * (1 + a_m_s2 / kG)).go(0.08 + late_s, 2, kWeight_N);
    const double rests_s = hand.t_s();
    EXPECT_NEAR(rests_s - nine_tenths_s, 0.15 + late_s, 1e-6);
    for (int ms = 0; ms < 1000; ++ms) {
        if (hand.now().weight_state == TACTILED_WEIGHT_STABLE) return hand.t_s() - rests_s;
        hand.step();
    }
    return kNaN;
}

TEST(GraspSettling, AnAccelerationWithinTheWindowNeedsNoWholeWindowAfterIt) {
    Hand hand;
    EXPECT_LT(stable_after_s(hand, 0.03), 0.08);
    EXPECT_NEAR(hand.now().weight_kg, kMass_kg, 0.004 * kMass_kg);
}

TEST(GraspSettling, TheWeightIsHeldOnWhileTheAccelerationLeavesTheWindow) {
    for (const double late_s : {0.02, 0.025, 0.03}) {
        Hand hand;
        ASSERT_LT(stable_after_s(hand, late_s, 5), 0.09);
        hand.each = [&](const tactiled_grasp& g) {
            ASSERT_EQ(g.weight_state, TACTILED_WEIGHT_STABLE) << late_s;
            ASSERT_NEAR(g.weight_kg, kMass_kg, 0.004 * kMass_kg);
        };
        hand.stay(1);
    }
}

// The load grows by 12 % of the weight a second. The halves of 70 ms differ by 0.42 %, which a whole window may.
TEST(GraspSettling, AShortPartMayTrendByLessThanAWholeWindow) {
    for (const int sign : {-1, 1}) {
        Hand hand;
        hand.noise_N = 1e-4;
        hand.close().lift(0).go(0.15, 2, kWeight_N);
        hand.each = [](const tactiled_grasp& g) { ASSERT_NE(g.weight_state, TACTILED_WEIGHT_STABLE) << g.weight_kg; };
        hand.go(1, 2, kWeight_N * (1 + sign * 0.12));
    }
}

// Every phase of a swing that begins with the lift, so that a crest is in the first part of a window that could suffice.
TEST(GraspSettling, NoSwingIsAWeightAtItsCrest) {
    for (const double frequency_Hz : {0.7, 1.0, 1.4})
        for (const double a_m_s2 : {3.0, 4.0})
            for (int phase = 0; phase < 24; ++phase) {
                Hand hand;
                const auto load_N = [&](double t_s) {
                    return kWeight_N * (1 + a_m_s2 / kG * std::sin(2 * M_PI * (frequency_Hz * t_s + double(phase) / 24)));
                };
                hand.close().go(0.1, 2, load_N(0));
                hand.each = [&](const tactiled_grasp& g) {
                    if (g.weight_state == TACTILED_WEIGHT_STABLE) {
                        ASSERT_NEAR(g.weight_kg, kMass_kg, 4 * g.weight_sd_kg) << frequency_Hz << " Hz, phase " << phase;
                    }
                };
                for (int ms = 1; ms <= 1500; ++ms) hand.go(0.001, 2, load_N(ms * 1e-3));
            }
}

TEST(GraspSettling, NoiseThatHidesASwingInTheShortPartMakesItWait) {
    Hand quiet, noisy;
    noisy.noise_N = 0.006;  // the blocks of 5 ms scatter by 0.2 % of the weight
    const double quiet_s = stable_after_s(quiet, 0.03), noisy_s = stable_after_s(noisy, 0.03);
    EXPECT_LT(quiet_s, 0.08);
    EXPECT_GT(noisy_s, 0.1);
}

}  // namespace
}  // namespace tactiled::grasp
