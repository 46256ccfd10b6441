// The lateness of frames from two clocks. Times in ms.
#include "drivers/wire/age_bound.hpp"

#include <gtest/gtest.h>

namespace tactiled {
namespace {

// Device and host, whose clocks agree but for what a test changes.
struct Clocks {
    double late(double delay_ms = 1, double step_ms = 10) {
        measured_ms += step_ms;
        return bound.late_ns(std::uint64_t((measured_ms + delay_ms) * 1e6), std::uint64_t((measured_ms + set_ms) * 1e6)) *
               1e-6;
    }
    void run(int frames, double delay_ms = 1) {
        for (int i = 0; i < frames; ++i) (void)late(delay_ms);
    }
    AgeBound bound{{.wrap_ns = 4294967296e3}};
    double measured_ms = 1000, set_ms = 1e6;
};

TEST(AgeBound, TheSmallestDelayIsTheReference) {
    Clocks clocks;
    clocks.run(100, 20);
    EXPECT_NEAR(clocks.late(5), 0, 0.1);
    EXPECT_NEAR(clocks.late(20), 15, 0.1);
}

TEST(AgeBound, AClockThatIsSetBackIsLateForLongerThanThatAndThenTheReferenceIsAsBefore) {
    Clocks clocks;
    clocks.run(1000);
    clocks.set_ms -= 5000;
    EXPECT_NEAR(clocks.late(), 5000, 1);
    EXPECT_EQ(clocks.bound.set_back(), 0u);
    clocks.run(545);
    EXPECT_GT(clocks.late(), 4990);
    clocks.run(10);
    EXPECT_EQ(clocks.bound.set_back(), 1u);
    EXPECT_NEAR(clocks.late(), 0, 1);
    EXPECT_NEAR(clocks.late(31), 30, 1);
}

TEST(AgeBound, ALagThatThereWasWhenAClockWasSetBackIsThereStill) {
    Clocks clocks;
    clocks.run(1000);
    clocks.run(100, 501);
    clocks.set_ms -= 5000;
    clocks.run(600, 501);
    EXPECT_EQ(clocks.bound.set_back(), 1u);
    EXPECT_NEAR(clocks.late(501), 500, 15);
    EXPECT_NEAR(clocks.late(1, 510), 0, 15);
}

TEST(AgeBound, AFrameThatWasOvertakenSetsNoClockBack) {
    Clocks clocks;
    clocks.run(1000);
    (void)clocks.late(31, -30);
    (void)clocks.late(1, 40);
    clocks.run(300);
    EXPECT_EQ(clocks.bound.set_back(), 0u);
    EXPECT_NEAR(clocks.late(), 0, 1);
}

// The ticks of MicroPython have 30 bits: 1073.7 s. A cable was out for longer than that.
TEST(AgeBound, AClockOf30BitsIsNotLateByTheEndsThatPassedInASilence) {
    for (const bool has_ended : {true, false})  // before the silence, so that its period is known
        for (const double silence_ms : {1.2e6, 2.5e6, 4e6}) {
            AgeBound bound({.wrap_ns = 4294967296e3});
            double now_ms = 1000;
            const auto late = [&](double step_ms) {
                now_ms += step_ms;
                const auto us = std::uint64_t(now_ms * 1000) & ((1u << 30) - 1);
                return bound.late_ns(std::uint64_t(now_ms * 1e6), us * 1000) * 1e-6;
            };
            for (int i = 0; i < (has_ended ? 120'000 : 60'000); ++i) (void)late(10);
            (void)late(silence_ms);
            for (int i = 0; i < (has_ended ? 0 : 110'000); ++i) (void)late(10);  // else it is seen at the next end
            EXPECT_LT(late(10), 50) << silence_ms << has_ended;
        }
}

TEST(AgeBound, AClockThatRunsAheadInJumpsIsNoClockAndOneThatIsSetOnOnceIs) {
    Clocks clocks;
    clocks.run(100);
    clocks.set_ms += 5000;
    clocks.run(100);
    EXPECT_FALSE(clocks.bound.is_no_clock());
    for (int i = 0; i < 20; ++i) {
        clocks.set_ms += 200;
        (void)clocks.late(1, 1000);
    }
    EXPECT_TRUE(clocks.bound.is_no_clock());
}

TEST(AgeBound, ABacklogThatComesAtOnceIsOneJump) {
    Clocks clocks;
    for (double delay_ms = 20'000; delay_ms > 0; delay_ms -= 200) (void)clocks.late(delay_ms, 200);  // a device of 5 Hz
    EXPECT_FALSE(clocks.bound.is_no_clock());
    EXPECT_TRUE(clocks.bound.is_falling());
    for (int i = 0; i < 2; ++i) (void)clocks.late(1, 200);
    EXPECT_FALSE(clocks.bound.is_falling());
    EXPECT_NEAR(clocks.late(101, 200), 100, 1);
}

TEST(AgeBound, JitterIsNoFall) {
    Clocks clocks;
    for (const double delay_ms : {36.0, 20.0, 0.0, 36.0, 0.0}) {
        (void)clocks.late(delay_ms, 40);
        EXPECT_FALSE(clocks.bound.is_falling());
    }
}

}  // namespace
}  // namespace tactiled
