// The first stable weight after an acceleration: the newest part of the window suffices where its beginning still moves,
// and finds the same swings as a whole window.
#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

constexpr double kMass_kg = 0.2, kWeight_N = kMass_kg * kG / 2;  // on one jaw

Setup with(double weigh_window_ms, double lift_accelerates_ms) {
    Setup setup = two_jaws();
    setup.weigh_window_ms = weigh_window_ms;
    setup.lift_accelerates_ms = lift_accelerates_ms;
    return setup;
}

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

// The newest part of a window of 50 ms has 7 blocks, which do not show noise and bend.
TEST(GraspSettling, AShortPartOfAShortWindowIsNotEnough) {
    Hand hand(with(50, 150));
    EXPECT_GT(stable_after_s(hand, 0.02), 0.04);
}

TEST(GraspSettling, LateAfterALiftOnlyAWholeWindowSuffices) {
    Hand hand;
    EXPECT_GT(stable_after_s(hand, 0.1), 0.08);
}

// The window begins at the lift-off and is weighed whole if the robot reports the acceleration.
TEST(GraspSettling, WithAReportedAccelerationOnlyAWholeWindowSuffices) {
    Hand hand;
    hand.each = [&](const tactiled_grasp&) { hand.grasp.acceleration({0, 0, 0}, std::uint64_t(hand.t_s() * 1e9)); };
    hand.close()
        .go(0.1, 2, 0.9 * kWeight_N)
        .go(0.02, 2, kWeight_N)
        .go(0.05, 2, kWeight_N * (1 + 2 / kG))
        .go(1e-3, 2, kWeight_N);
    hand.stay(0.09);
    EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    hand.stay(0.05);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
}

// The swings of one frequency and size that begin with the lift, with one phase each.
struct Swings {
    int wrong = 0;                // phases in which a weight was STABLE and more than 4 sd wrong
    double longest_s = 0;         // the longest time of such a weight in one phase
    double largest_relative = 0;  // the largest error of such a weight
};

Swings swing(double frequency_Hz, double a_m_s2, const Setup& setup, int phases = 16) {
    Swings found;
    for (int phase = 0; phase < phases; ++phase) {
        Hand hand(setup);
        const auto load_N = [&](double t_s) {
            return kWeight_N * (1 + a_m_s2 / kG * std::sin(2 * M_PI * (frequency_Hz * t_s + double(phase) / phases)));
        };
        hand.close().go(0.1, 2, load_N(0));
        double wrong_s = 0;
        hand.each = [&](const tactiled_grasp& g) {
            const double error_kg = std::abs(g.weight_kg - kMass_kg);
            if (g.weight_state != TACTILED_WEIGHT_STABLE || error_kg <= 4 * g.weight_sd_kg) return;
            wrong_s += 1e-3;
            found.largest_relative = std::max(found.largest_relative, error_kg / kMass_kg);
        };
        for (int ms = 1; ms <= 2000; ++ms) hand.go(0.001, 2, load_N(ms * 1e-3));
        found.wrong += wrong_s > 0;
        found.longest_s = std::max(found.longest_s, wrong_s);
    }
    return found;
}

// The crest of a slow swing is a steady acceleration for the length of the window. The bound says which ones.
TEST(GraspSettling, NoSwingAboveTheBoundIsAWeightAtItsCrest) {
    struct Case {
        double weigh_window_ms, frequency_Hz;
    };
    for (const auto& [window_ms, f_Hz] : {Case{100, 0.7},
                                          {100, 0.8},
                                          {100, 1},
                                          {100, 1.4},
                                          {150, 0.5},
                                          {150, 0.7},
                                          {200, 0.4},
                                          {200, 0.5},
                                          {200, 0.7},
                                          {400, 0.2},
                                          {400, 0.3}}) {
        const double bound_m_s2 = max_hidden_swing_m_s2(f_Hz, window_ms);
        for (const double times : {1.05, 1.3, 1.8})
            EXPECT_EQ(swing(f_Hz, times * bound_m_s2, with(window_ms, 150)).wrong, 0)
                << window_ms << " ms, " << f_Hz << " Hz, " << times * bound_m_s2 << " m/s^2";
        // The bound is no larger than it must be.
        EXPECT_GT(swing(f_Hz, 0.5 * bound_m_s2, with(window_ms, 150)).wrong, 0) << window_ms << " ms, " << f_Hz << " Hz";
    }
}

TEST(GraspSettling, TheBoundFallsWithTheSquareOfTheWindow) {
    EXPECT_LT(max_hidden_swing_m_s2(1, 100), 1.5);
    EXPECT_LT(max_hidden_swing_m_s2(1, 200), 0.35);
    EXPECT_TRUE(std::isinf(max_hidden_swing_m_s2(0.3, 100)));
}

TEST(GraspSettling, ASwingBelowTheBoundIsWrongByItsAccelerationAndForLessThanASecond) {
    for (const double f_Hz : {0.2, 0.5, 0.7, 1.0})
        for (const double a_m_s2 : {0.5, 2.0, 4.0}) {
            const Swings found = swing(f_Hz, a_m_s2, with(100, 150));
            EXPECT_LE(found.longest_s, 0.7) << f_Hz << ' ' << a_m_s2;
            EXPECT_LE(found.largest_relative, 1.01 * a_m_s2 / kG) << f_Hz << ' ' << a_m_s2;
        }
}

TEST(GraspSettling, TheDefaultTimeAfterALiftFindsTheSwingsOfAnArm) {
    const grasp::Setup configured;
    const grasp::Setup defaults = with(configured.weigh_window_ms, configured.lift_accelerates_ms);
    for (const double f_Hz : {0.6, 0.7, 0.85, 1.0, 1.4, 2.0})
        for (const double a_m_s2 : {0.6, 1.0, 2.0, 2.5, 4.0})
            EXPECT_EQ(swing(f_Hz, a_m_s2, defaults).wrong, 0) << f_Hz << ' ' << a_m_s2;
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
