// The check of jumps alone: glitches, steps, ringing, gaps and noise.
#include "node/jump_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace tactiled {
namespace {

constexpr std::uint64_t kPeriod_ns = 10'000'000;

// A force along z whose sd is 0.1 N, sampled at 100 Hz.
class Force {
public:
    bool take(double fz_N, std::uint32_t lost = 0, double sd_N = 0.1) {
        t_ns_ += (1 + lost) * kPeriod_ns;
        const Wrench nothing = kUnseen;
        Wrench wrench_S = nothing, sd = nothing;
        wrench_S[2] = fz_N;
        sd[2] = sd_N;
        return check.confirm(wrench_S, sd, t_ns_, lost);
    }
    // One letter for each value: '.' confirmed, 'x' not.
    std::string take_all(const std::vector<double>& fz_N) {
        std::string all;
        for (const double value : fz_N) all += take(value) ? '.' : 'x';
        return all;
    }
    void rest(double fz_N, int samples = 20) {
        for (int i = 0; i < samples; ++i) (void)take(fz_N);
    }
    JumpCheck check;

private:
    std::uint64_t t_ns_ = 1'000'000'000;
};

TEST(JumpCheck, TheFirstValueIsConfirmedByTheSecond) {
    Force force;
    EXPECT_EQ(force.take_all({5, 5, 5}), "x..");
    force.check.end_motion();
    EXPECT_EQ(force.take_all({5, 5, 5}), "...") << "the value before the gap";
    force.check.end_motion();
    EXPECT_EQ(force.take_all({0, 0, 0}), "x..");
    EXPECT_FALSE(force.check.is_frequent());
}

// A converter is often wrong after its power has come.
TEST(JumpCheck, AWrongValueAfterAStartIsNotConfirmed) {
    Force first, second, moving;
    EXPECT_EQ(first.take_all({-20, 0, 0, 0, -3, 0}), "xx..x.");
    EXPECT_EQ(second.take_all({0, -20, 0, 0, -3, 0}), "xx..x.");
    EXPECT_EQ(moving.take_all({0, 1, 2, 3, 4}), "xx...");
    second.check.end_motion();
    EXPECT_EQ(second.take_all({-20, 0, 0, 0}), "xx..") << "nor after a reopening";
}

// Saturated or missing channels come beside the glitches of a bad cable.
TEST(JumpCheck, ASampleWithoutSdOrWithoutAValueOpensNothing) {
    Force force;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    force.rest(0);
    (void)force.take(0, 0, nan);
    EXPECT_FALSE(force.take(-8));
    EXPECT_TRUE(force.take(0));
    (void)force.take(nan);
    EXPECT_FALSE(force.take(-8));
    EXPECT_TRUE(force.take(0));
    force.check.miss();
    EXPECT_FALSE(force.take(-8));
    force.check.miss();
    EXPECT_FALSE(force.take(-8)) << "not confirmed over a gap";
    EXPECT_FALSE(force.take(0, 3) && force.take(-8, 3)) << "nor beside lost samples";
}

TEST(JumpCheck, AGlitchAfterAStepOpensNothing) {
    Force force;
    force.rest(0);
    EXPECT_EQ(force.take_all({-8, -8, -8, 0, -8, 0, -8}), "x..x.x.");
}

// Touches of a slow sensor, of two or three samples, before and after glitches.
TEST(JumpCheck, TouchesDoNotKeepGlitchesFrequent) {
    Force force;
    force.rest(0, 100);
    for (int i = 0; i < 6; ++i) (void)force.take_all({6, 0, 0, 0});
    ASSERT_TRUE(force.check.is_frequent());
    for (int i = 0; i < 100; ++i) {
        (void)force.take_all({6, 6, 6});
        force.rest(0, 97);
    }
    EXPECT_FALSE(force.check.is_frequent());
}

TEST(JumpCheck, AGlitchIsNotConfirmedAndAStepCostsOneSample) {
    Force force;
    force.rest(0);
    EXPECT_EQ(force.take_all({0, -7, 0, 0, 7, 0, 0}), ".x..x..");
    force.rest(0, 2000);
    EXPECT_EQ(force.take_all({-7, -7, -7, -7, 0, 0, 0}), "x...x..");
    EXPECT_EQ(force.take_all({0, 0.3, 0, -0.3, 0}), ".....") << "within the stated noise";
}

// A channel damaged right beside the real step of another one.
TEST(JumpCheck, AGlitchOfAComponentBesideTheStepOfAnotherIsNotConfirmed) {
    JumpCheck check;
    std::uint64_t t_ns = 1'000'000'000;
    const auto take = [&](double fx_N, double fz_N) {
        Wrench wrench_S = kUnseen, sd = kUnseen;
        wrench_S[0] = fx_N, wrench_S[2] = fz_N;
        sd[0] = sd[2] = 0.1;
        return check.confirm(wrench_S, sd, t_ns += kPeriod_ns, 0);
    };
    for (int i = 0; i < 20; ++i) (void)take(0, 0);
    EXPECT_FALSE(take(0, -6));
    EXPECT_FALSE(take(200, -6));
    EXPECT_TRUE(take(0, -6));
    EXPECT_FALSE(take(200, -6)) << "the glitch has opened nothing";
    EXPECT_TRUE(take(0, -6));
}

// The oscillation after an impact leaves the rest with each sample.
TEST(JumpCheck, RingingIsOneMotion) {
    Force force;
    force.rest(0);
    std::vector<double> ringing;
    for (int i = 0; i < 100; ++i) ringing.push_back(5 * std::exp(-i / 30.0) * std::cos(2.1 * i));
    const std::string seen = force.take_all(ringing);
    EXPECT_EQ(seen[0], 'x');
    EXPECT_EQ(seen.find('x', 1), std::string::npos) << seen;
}

TEST(JumpCheck, ASmoothMotionLosesAtMostItsFirstSample) {
    Force force;
    force.rest(0);
    int lost = 0;
    for (int i = 0; i < 1000; ++i) lost += force.take(10 * std::sin(2 * std::numbers::pi * i / 50)) ? 0 : 1;
    EXPECT_LE(lost, 2);
    Force ramp;
    ramp.rest(0);
    EXPECT_EQ(ramp.take_all({0, 1, 2, 3, 4, 5, 6, 7, 8}), ".x.......");
    EXPECT_TRUE(ramp.take(12, 3)) << "three samples are lost, and the ramp goes on";
    EXPECT_FALSE(ramp.take(12 + 51, 50)) << "no motion is known for so long";
}

TEST(JumpCheck, FrequentGlitchesNeedMoreConfirmation) {
    Force force;
    force.rest(0, 1000);
    for (int i = 0; i < 12; ++i) {
        EXPECT_FALSE(force.check.is_frequent()) << i;
        EXPECT_FALSE(force.take(6));
        force.rest(0, 19);
        if (i == 0) force.rest(0, 600);
        if (force.check.is_frequent()) break;
    }
    EXPECT_TRUE(force.check.is_frequent());
    EXPECT_EQ(force.take_all({6, 6, 0, 6, 6, 6, 6}), "xx.xxx.");
    force.rest(6, 4000);
    EXPECT_FALSE(force.check.is_frequent());
    JumpCheck next;
    Force again;
    again.rest(0);
    for (int i = 0; i < 4; ++i) (void)again.take_all({9, 0});
    ASSERT_TRUE(again.check.is_frequent());
    next.succeed(again.check);
    EXPECT_TRUE(next.is_frequent());
}

// One glitch is no share, however few samples there are.
TEST(JumpCheck, OneGlitchOfASlowSensorIsNotFrequent) {
    Force force;
    force.rest(0, 5);
    (void)force.take_all({9, 0});
    EXPECT_FALSE(force.check.is_frequent());
}

TEST(JumpCheck, WhiteNoiseOfTheStatedSdIsNoJump) {
    Force force;
    std::mt19937_64 random(3);
    std::normal_distribution<double> noise(0, 0.1);
    int lost = 0;
    for (int i = 0; i < 100'000; ++i) lost += force.take(noise(random)) ? 0 : 1;
    EXPECT_LE(lost, 1);
    EXPECT_FALSE(force.check.is_frequent());
}

TEST(JumpCheck, AComponentWithoutAValueOrSdIsNotChecked) {
    Force force;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (int i = 0; i < 3; ++i) (void)force.take(1, 0, nan);
    EXPECT_TRUE(force.take(50, 0, nan));
    Force gap;
    gap.rest(1);
    EXPECT_EQ(gap.take_all({nan, 1, 1}), "...");
}

}  // namespace
}  // namespace tactiled
