// What a known weight teaches, and when it must teach nothing: a wrong scale looks as stable as a right one.
#include <random>

#include "tests/unit/grasp/leaking.hpp"

namespace tactiled::grasp {
namespace {

TEST_F(Leaking, AKnownWeightIsNoneWhileATareIsInForce) {
    take(2, 0.2);
    ASSERT_TRUE(hand.grasp.zero_weight());
    hand.go(0.05, 2, 0.3 * kG / 2).stay(1);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_FALSE(hand.grasp.known_weight(0.1));
    EXPECT_NEAR(hand.now().weight_kg, 0.1, 0.001);
    EXPECT_EQ(hand.grasp.check().scale, 1);
    EXPECT_FALSE(learnt());
}

TEST_F(Leaking, ForgettingUnderATareLeavesWhatIsTold) {
    take(2, 0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0.2));
    ASSERT_TRUE(hand.grasp.zero_weight());
    ASSERT_TRUE(hand.grasp.known_weight(0));
    EXPECT_NEAR(hand.now().weight_kg, 0, 1e-9);
    hand.go(0.05, 2, 0.25 * kG / 2).stay(1);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.05, 0.0005);
}

TEST_F(Leaking, ForgottenAreScaleAndLeakAtOnce) {
    take(2, 0.2);
    const double before_kg = hand.now().weight_kg;
    ASSERT_TRUE(hand.grasp.known_weight(0.21));
    ASSERT_TRUE(learnt());
    hand.stay(0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0));
    EXPECT_FALSE(learnt());
    EXPECT_EQ(hand.grasp.check().scale, 1);
    EXPECT_EQ(hand.now().scale_shown, 0u);
    EXPECT_NEAR(hand.now().weight_kg, before_kg, 0.0001);
    hand.each = [&](const tactiled_grasp& g) {
        EXPECT_EQ(g.weight_state, TACTILED_WEIGHT_STABLE);
        EXPECT_NEAR(g.weight_kg, before_kg, 0.0001);
    };
    hand.stay(1);
    hand.each = nullptr;
    release();
    EXPECT_NEAR(error_kg(0.6, 0.05), 2 * leak_N(0.6) / kG, 0.0005);
}

TEST_F(Leaking, ForgottenAndShownAgainInOneHoldItIsAsBefore) {
    take(2, 0.2);
    ASSERT_TRUE(hand.grasp.known_weight(0.21));
    const Check first = hand.grasp.check();
    hand.stay(0.02);
    for (int i = 0; i < 5; ++i) {
        ASSERT_TRUE(hand.grasp.known_weight(0));
        hand.stay(0.003 * i);
        ASSERT_TRUE(hand.grasp.known_weight(0.21));
        EXPECT_NEAR(hand.grasp.check().scale, first.scale, 0.0005) << i;
        EXPECT_EQ(hand.grasp.check().leak[0].shear_N, first.leak[0].shear_N);
        hand.stay(0.1);
        EXPECT_NEAR(hand.now().weight_kg, 0.21, 0.0002) << i;
    }
    release();
    EXPECT_NEAR(error_kg(2, 0.2), 0.01, 0.0003);
}

// However slow, from whenever on, at whatever rate: the weight that is told later is off by no more than it says.
TEST(SlowLift, IsNeverTakenForALeak) {
    for (const double rate_hz : {60.0, 64.0, 80.0, 100.0, 120.0, 250.0, 1000.0})
        for (const double lift_s : {0.3, 1.0, 2.0, 5.0, 10.0, 30.0, 100.0})
            for (const double before_s : {-0.1, 0.0, 0.15, 0.3, 1.0}) {  // from the end of the closing
                Hand hand;
                hand.rate_hz = rate_hz;
                hand.spoil = [](std::size_t, JawSample& s) {
                    s.sd_N = {1e-4, 1e-4, 1e-4};
                };  // so that the leak's own counts
                const double load_N = 0.1 * kG / 2, begun_N = before_s < 0 ? -before_s / lift_s * load_N : 0;
                hand.go(0.5, 0, 0).go(0.2 + std::min(before_s, 0.0), 2 + 10 * std::min(before_s, 0.0), 0);
                if (before_s < 0) hand.go(-before_s, 2, begun_N);
                if (before_s > 0) hand.stay(before_s);
                hand.go(lift_s, 2, load_N).stay(10);  // what is held follows what creeps in some seconds
                if (!hand.grasp.known_weight(0.1)) continue;
                hand.go(0.2, 2, 0).go(0.2, 0, 0).stay(0.3);
                hand.go(0.2, 2, 0).stay(0.3).go(0.15, 2, 0.02 * kG / 2).stay(0.4);
                ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
                EXPECT_LE(std::abs(hand.now().weight_kg - 0.02), 2 * hand.now().weight_sd_kg)
                    << rate_hz << " Hz, " << lift_s << " s, " << before_s << " s";
                EXPECT_NEAR(hand.grasp.check().scale, 1, 0.012)
                    << rate_hz << " Hz, " << lift_s << " s, " << before_s << " s";
            }
}

TEST_F(Leaking, ItIsLearntAtAnyRateThatAGraspCanBeFollowedAt) {
    for (const double rate_hz : {40.0, 50.0, 60.0, 64.0, 80.0, 120.0, 500.0, 2000.0}) {
        hand = Hand();
        leak(hand);
        hand.rate_hz = rate_hz;
        press_N = 2;
        hand.go(0.5, 0, 0).go(0.4, 2, 0).stay(0.5).go(0.15, 2, 0.2 * kG / 2).stay(0.5);
        ASSERT_TRUE(hand.grasp.known_weight(0.2)) << rate_hz;
        EXPECT_TRUE(learnt()) << rate_hz;
        EXPECT_NEAR(hand.grasp.check().scale, 1, 0.004) << rate_hz;
    }
}

TEST_F(Leaking, ALightWeightInAFirmGripTeachesNothing) {  // 16 mN of leak beside 68 mN of weight may be a force as well
    const auto leaks = hand.spoil;
    hand.spoil = [leaks](std::size_t j, JawSample& s) {
        leaks(j, s);
        s.sd_N = {0.0005, 0.0005, 0.0005};
    };
    hand.go(0.5, 0, 0).go(0.2, 2, 0).stay(0.6).go(0.15, 2, 0.0138 * kG / 2).stay(0.4);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    ASSERT_LT(hand.now().weight_sd_kg, 0.05 * hand.now().weight_kg);
    EXPECT_FALSE(hand.grasp.known_weight(0.0138));
    EXPECT_EQ(hand.grasp.check().mass_kg, 0);
}

// One jaw lets go and touches again: a part of the load is on it when it is at rest.
TEST_F(Leaking, WhatIsTakenHoldOfInTheAirShowsNone) {
    const auto leaks = hand.spoil;
    bool away = false;
    double less_N = 0;
    hand.spoil = [&](std::size_t j, JawSample& s) {
        leaks(j, s);
        if (j != 1) return;
        s.force_S_N[1] += less_N;
        if (away) s.force_S_N = {0, 0, 0};
    };
    press_N = 2;
    hand.go(0.5, 0, 0).go(0.2, 2, 0).stay(0.3).go(0.15, 2, 0.2 * kG / 2).stay(0.4);
    away = true;
    hand.stay(0.5);
    away = false;
    less_N = 0.2 * kG / 2;  // the other bears it
    hand.stay(0.5).go(0.15, 2, 0.5 * kG / 2).stay(0.6);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    ASSERT_TRUE(hand.grasp.known_weight(0.4));
    EXPECT_FALSE(learnt());
}

// Zeros that walk, 2 mN in a second: a light weight is weighed to 3 % or so. What a check with it leaves unsure is in every
// weight after it, and is said as truly as it was of the light weight itself.
TEST(LightKnownWeight, LeavesAnHonestDeviation) {
    struct Within {
        int n = 0, one = 0, two = 0;
        void take(const tactiled_grasp& g, double mass_kg) {
            const double off = std::abs(g.weight_kg - mass_kg) / g.weight_sd_kg;
            ++n;
            one += off <= 1;
            two += off <= 2;
        }
        [[nodiscard]] double one_part() const { return double(one) / n; }
        [[nodiscard]] double two_part() const { return double(two) / n; }
    } light, heavy, with_leak;
    for (std::uint64_t seed = 1; seed <= 400; ++seed) {
        Hand hand(two_jaws(), seed);
        hand.rate_hz = 250;
        hand.noise_N = 0.0002;
        std::mt19937_64 random(seed);
        std::array<double, 2> walk_N{};
        hand.spoil = [&](std::size_t j, JawSample& s) {
            walk_N[j] += 0.002 * std::sqrt(1 / 250.0) * (random() % 2 == 0 ? 1 : -1);
            s.force_S_N[1] += walk_N[j];
            s.sd_N = {1e-4, 1e-4, 1e-4};
        };
        hand.go(2, 0, 0).go(0.2, 1, 0).stay(0.3).go(0.15, 1, 0.0138 * kG / 2).stay(0.4);
        light.take(hand.now(), 0.0138);
        if (!hand.grasp.known_weight(0.0138)) continue;
        hand.go(0.2, 1, 0).go(0.2, 0, 0).stay(1).go(0.2, 1, 0).stay(0.3).go(0.15, 1, 0.057 * kG / 2).stay(0.4);
        if (hand.now().weight_state != TACTILED_WEIGHT_STABLE) continue;
        heavy.take(hand.now(), 0.057);
        if (hand.now().scale_shown == 2) with_leak.take(hand.now(), 0.057);
    }
    ASSERT_GE(heavy.n, 350);
    ASSERT_GE(with_leak.n, 40);
    EXPECT_GE(heavy.one_part(), light.one_part() - 0.03);
    EXPECT_GE(heavy.two_part(), light.two_part() - 0.03);
    EXPECT_GE(heavy.two_part(), 0.87);
    EXPECT_LE(heavy.one_part(), 0.8);
    EXPECT_GE(with_leak.two_part(), 0.9);
}

}  // namespace
}  // namespace tactiled::grasp
