// Two jaws whose press leaks into their shear.
#pragma once
#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {

// A leak that rises fast and comes back, as a skin with hysteresis has it: 24 mN at 0.5 N, 16 mN at 2 N.
inline double leak_N(double press_N) { return press_N <= 0 ? 0 : 0.064 * press_N * std::exp(-press_N) + 0.0015 * press_N; }

class Leaking : public testing::Test {
protected:
    Leaking() { leak(hand); }
    void leak(Hand& of) {
        of.spoil = [this](std::size_t, JawSample& s) {
            const double leak = leak_N(-s.force_S_N[2]);
            s.force_S_N[0] += along_x * leak;
            s.force_S_N[1] -= leak;
        };
    }
    void release() { hand.go(0.2, press_N, 0).go(0.2, 0, 0).stay(0.3); }
    void take(double press, double mass_kg) {
        press_N = press;
        hand.go(0.5, 0, 0).go(0.2, press, 0).stay(0.3).go(0.15, press, mass_kg * kG / 2).stay(0.4);
    }
    double error_kg(double press, double mass_kg) {
        take(press, mass_kg);
        EXPECT_EQ(hand.now().weight_state, TACTILED_WEIGHT_STABLE);
        return hand.now().weight_kg - mass_kg;
    }
    [[nodiscard]] bool learnt() const { return hand.grasp.check().leak[0].press_N > 0; }

    Hand hand;
    double along_x = 0, press_N = 0;
};

}  // namespace tactiled::grasp
