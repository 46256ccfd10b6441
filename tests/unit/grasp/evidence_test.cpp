// The jaws must agree: no weight is stable if its forces contradict it, and the doubt names the jaw.
#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

constexpr double kMass_kg = 0.2;

// Lifts, and expects a weight that is never stable, with doubts that include one of `bits`.
void expect_never_stable(Hand& hand, std::uint32_t bits, std::uint32_t jaws) {
    hand.close();
    hand.each = [](const tactiled_grasp& g) { ASSERT_NE(g.weight_state, TACTILED_WEIGHT_STABLE) << g.weight_kg; };
    hand.lift(kMass_kg).stay(2);
    EXPECT_NE(hand.now().weight_doubts & bits, 0u) << hand.now().weight_doubts;
    EXPECT_EQ(hand.now().doubtful & jaws, jaws);
}

TEST(GraspEvidence, OfARightGraspNothingIsInDoubt) {
    Hand hand;
    hand.close().lift(kMass_kg);
    hand.each = [](const tactiled_grasp& g) {
        EXPECT_EQ(g.weight_state, TACTILED_WEIGHT_STABLE);
        EXPECT_EQ(g.weight_doubts, 0u);
        EXPECT_EQ(g.doubtful, 0u);
    };
    hand.stay(30);
}

TEST(GraspEvidence, AJawWhoseShearIsDeadIsNamed) {
    for (const std::size_t dead : {0u, 1u}) {
        Hand hand;
        hand.spoil = [=](std::size_t j, JawSample& s) {
            if (j == dead) s.force_S_N[0] = s.force_S_N[1] = 0;
        };
        expect_never_stable(hand, TACTILED_DOUBT_DEAD_SHEAR, 1u << dead);
        EXPECT_EQ(hand.now().doubtful, 1u << dead);
    }
}

TEST(GraspEvidence, AJawThatIsTurnedRoundContradictsTheOther) {
    Hand hand;
    hand.spoil = [](std::size_t j, JawSample& s) {
        if (j == 1) s.force_S_N[1] *= -1;
    };
    expect_never_stable(hand, TACTILED_DOUBT_SHARES, 2u);
}

// The sum is the weight; an object that is held off its centre loads the jaws unevenly.
TEST(GraspEvidence, ASplitOfTheLoadIsNoPartOfTheSdWithASensorInEachJaw) {
    const auto weighed = [](double left) {
        Hand hand;
        hand.spoil = [=](std::size_t j, JawSample& s) {
            for (std::size_t k = 0; k < 2; ++k) s.force_S_N[k] *= 2 * (j == 0 ? left : 1 - left);
        };
        hand.close().lift(kMass_kg);
        return hand.now();
    };
    const tactiled_grasp even = weighed(0.5);
    for (const double left : {0.3, 0.4, 0.6, 0.7}) {
        const tactiled_grasp split = weighed(left);
        EXPECT_EQ(split.weight_state, unsigned(TACTILED_WEIGHT_STABLE)) << left;
        EXPECT_EQ(split.weight_doubts, 0u) << left;
        EXPECT_NEAR(split.weight_kg, even.weight_kg, even.weight_sd_kg) << left;
        EXPECT_LE(split.weight_sd_kg, 1.5 * even.weight_sd_kg) << left;
    }
}

TEST(GraspEvidence, AJawAtHalfGainDoesNotBalance) {
    Hand hand;
    hand.spoil = [](std::size_t j, JawSample& s) {
        for (double& f : s.force_S_N) f *= j == 0 ? 0.5 : 1;
    };
    expect_never_stable(hand, TACTILED_DOUBT_BALANCE, 0u);
}

TEST(GraspEvidence, AJawWithoutASensorLeavesTheBalanceOpen) {
    grasp::Setup setup = two_jaws();
    setup.jaws_of_gripper = 3;
    Hand hand(setup);
    hand.spoil = [](std::size_t j, JawSample& s) { s.force_S_N[2] *= j == 0 ? 0.8 : 1; };
    hand.close().lift(kMass_kg);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
}

TEST(GraspEvidence, LessThanNothingIsNoWeight) {
    grasp::Setup setup = two_jaws();
    setup.gravity_G = {0, 0, -kG};
    Hand hand(setup);
    expect_never_stable(hand, TACTILED_DOUBT_NEGATIVE, 0u);
    EXPECT_LT(hand.now().weight_kg, 0);
}

TEST(GraspEvidence, ATiltThatIsNotReportedIsNoWeight) {
    Hand hand;
    const double tilt = 30 * M_PI / 180;
    hand.spoil = [&](std::size_t j, JawSample& s) {  // in the plane of the closing axis: the shear shrinks, one press grows
        const double load_N = -s.force_S_N[1] * 2;
        s.force_S_N[1] *= std::cos(tilt);
        s.force_S_N[2] += (j == 0 ? 0.5 : -0.5) * load_N * std::sin(tilt);
    };
    expect_never_stable(hand, TACTILED_DOUBT_BALANCE, 0u);
}

TEST(GraspEvidence, AGainThatCreepsWhileHeldEndsTheStableWeight) {
    Hand hand;
    hand.close().lift(kMass_kg);
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    const double begins_s = hand.t_s();
    hand.spoil = [&](std::size_t j, JawSample& s) {
        for (double& f : s.force_S_N) f *= j == 1 ? 1 + 0.012 * (hand.t_s() - begins_s) : 1;
    };
    hand.each = [](const tactiled_grasp& g) {
        if (g.weight_state == TACTILED_WEIGHT_STABLE) { ASSERT_LT(std::abs(g.weight_kg - kMass_kg), 4 * g.weight_sd_kg); }
    };
    hand.stay(30);
    EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NE(hand.now().weight_doubts & TACTILED_DOUBT_CREEPS, 0u);
}

TEST(GraspEvidence, AZeroThatDriftsWhileHeldEndsTheStableWeight) {
    for (const bool both : {false, true}) {
        Hand hand;
        hand.close().lift(kMass_kg);
        const double begins_s = hand.t_s();
        hand.spoil = [&](std::size_t j, JawSample& s) {
            if (both || j == 0) s.force_S_N[1] -= 0.01 * (hand.t_s() - begins_s);
        };
        hand.each = [](const tactiled_grasp& g) {
            if (g.weight_state == TACTILED_WEIGHT_STABLE) {
                ASSERT_LT(std::abs(g.weight_kg - kMass_kg), 4 * g.weight_sd_kg);
            }
        };
        hand.stay(30);
        EXPECT_NE(hand.now().weight_state, TACTILED_WEIGHT_STABLE) << both;
    }
}

TEST(GraspEvidence, ASwingIsNoWeightAtItsCrest) {
    for (const double frequency_Hz : {0.7, 1.0, 1.4}) {
        Hand hand;
        hand.close().lift(kMass_kg).stay(1);
        ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
        hand.each = [](const tactiled_grasp& g) {
            if (g.weight_state == TACTILED_WEIGHT_STABLE) { ASSERT_NEAR(g.weight_kg, kMass_kg, 4 * g.weight_sd_kg); }
        };
        for (int i = 0; i < 10'000; ++i) {
            const double a_m_s2 = 3 * std::sin(2 * M_PI * frequency_Hz * i * 1e-3);
            hand.go(0.001, 2, kMass_kg * (kG + a_m_s2) / 2);
        }
    }
}

TEST(GraspEvidence, AnotherLoadBecomesStableOnceItRests) {
    Hand hand;
    hand.close().lift(kMass_kg).stay(1).go(0.05, 2, 0.3 * kG / 2).stay(1.5);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 0.3, 0.001);
}

TEST(GraspEvidence, AJawThatIsLateDelaysTheWeight) {
    Hand hand;
    std::vector<double> loads;
    hand.spoil = [&](std::size_t j, JawSample& s) {
        if (j == 0) loads.push_back(s.force_S_N[1]);
        if (j == 1) s.force_S_N[1] = loads.size() > 300 ? loads[loads.size() - 301] : 0;
    };
    hand.close();
    hand.each = [](const tactiled_grasp& g) {
        if (g.weight_state == TACTILED_WEIGHT_STABLE) { ASSERT_NEAR(g.weight_kg, kMass_kg, 4 * g.weight_sd_kg); }
    };
    const double weight_N = kMass_kg * kG / 2;
    hand.go(0.05, 2, 1.2 * weight_N).stay(0.1).go(0.02, 2, weight_N).stay(2);
    EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
}

TEST(GraspEvidence, SixteenJawsMayHaveSensorsAndOneDeadIsNamed) {
    grasp::Setup setup = two_jaws();
    setup.jaws.clear();
    for (std::uint32_t j = 0; j < 16; ++j) {
        setup.jaws.push_back(two_jaws().jaws[j % 2]);
        setup.jaws.back().sensor = j;
    }
    Hand hand(setup);
    hand.close().lift(1.6 / 8);  // Hand::lift gives each jaw half of its mass
    ASSERT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_NEAR(hand.now().weight_kg, 1.6, 0.005);
    Hand damaged(setup);
    damaged.spoil = [](std::size_t j, JawSample& s) {
        if (j == 13) s.force_S_N[0] = s.force_S_N[1] = 0;
    };
    damaged.close().lift(1.6 / 8);
    EXPECT_NE(damaged.now().weight_state, TACTILED_WEIGHT_STABLE);
    EXPECT_EQ(damaged.now().doubtful, 1u << 13);
}

}  // namespace
}  // namespace tactiled::grasp
