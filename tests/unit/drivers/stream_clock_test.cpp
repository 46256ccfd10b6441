// The proof of the age by the device's clock.
#include <gtest/gtest.h>

#include "delayed_device.hpp"

namespace tactiled {
namespace {

TEST(StreamAge, ABacklogHasTheTimesAtWhichItWasMeasured) {
    Device device(network());
    device.run(1000);
    Frame frame = device.next(2000);  // 2 s late
    EXPECT_NEAR(double(frame.taken_ns - frame.t_ns), 1999e6, 1e6);
    EXPECT_NEAR(double(frame.late_ns), 1999e6, 1e6);
    EXPECT_EQ(frame.age, Age::proved);
    frame = device.next(1990);
    EXPECT_NEAR(double(frame.late_ns), 1989e6, 1e6);
    frame = device.next(1, 2010);
    EXPECT_LT(frame.late_ns, kMs);
}

TEST(StreamAge, ABridgeAsFastAsTheDeviceStaysLateForAnHour) {
    Device device(network());
    device.run(60'000);
    for (int i = 0; i < 360'000; ++i) ASSERT_GT(device.next(300).late_ns, 200 * kMs) << i;
    EXPECT_LT(device.next(1, 310).late_ns, 30 * kMs);
}

TEST(StreamAge, ALagThatGrowsFasterThanClocksDriftIsNotLearned) {
    Device device(network());
    device.run(1000);
    for (int i = 0; i < 60'000; ++i) (void)device.next(1 + 0.005 * i);  // 500 ppm
    EXPECT_GT(device.next(301).late_ns, 100 * kMs);
}

TEST(StreamAge, AClockThatIsSetOnInALagLeavesTheAgeUnproved) {
    Device device(network());
    device.run(1000);
    device.run(100, 2000);
    device.clock_zero_ns -= 5 * kS;
    for (int i = 0; i < 200; ++i) ASSERT_EQ(device.next(2000).age, Age::unproved) << i;
}

TEST(StreamAge, AClockThatBeginsAgainCostsNoSampleAndAFrameOfThePastIsLate) {
    Device device(network());
    device.run(1000);
    device.clock_zero_ns = device.measured_ns + 500 * kMs;  // it restarts, in half a second
    device.sequence = 0;
    EXPECT_EQ(device.next(1, 600).late_ns, 0u);
    Device uncounted(network(), true, false);
    uncounted.run(1000);
    uncounted.clock_zero_ns = uncounted.measured_ns + 500 * kMs;
    EXPECT_EQ(uncounted.next(1, 600).late_ns, 0u);
    device.run(1000);
    const std::uint64_t now = device.measured_ns;
    device.measured_ns -= 2 * kS;  // old content under a new number
    const Frame old = device.next(2001);
    EXPECT_GT(old.late_ns, 1900 * kMs);
    device.measured_ns = now;
    EXPECT_LT(device.next().late_ns, 2 * kMs);
}

TEST(StreamAge, AClockThatWasSetBackIsLateForTwoSeconds) {
    Device device(network());
    device.run(1000);
    device.clock_zero_ns += 5 * kS;
    int late = 0;
    for (int i = 0; i < 300; ++i) late += device.next().late_ns > 100 * kMs;
    EXPECT_NEAR(late, 200, 5);
}

TEST(StreamAge, AClockOf32BitsThatPassedItsEndWhileTheLinkWasClosedIsNoRestart) {
    for (const double lag_ms : {0.0, 2000.0}) {
        Device device(network());
        device.clock_zero_ns = device.measured_ns - 4290 * kS;  // it begins again after 4294.97 s
        device.run(400);
        device.run(10, 1 + lag_ms);
        device.open(network());
        device.clock_zero_ns += 4'294'967'296'000;
        EXPECT_NEAR(double(device.next(1 + lag_ms, 5000).late_ns) * 1e-6, lag_ms, 1);
    }
}

TEST(StreamAge, AClockOf30BitsThatPassesItsEndIsNoRestart) {
    for (const double lag_ms : {0.0, 2000.0}) {
        Device device(network());
        device.clock_zero_ns = device.measured_ns - 1070'005 * kMs;  // it begins again after 1073.742 s
        device.run(373);
        device.clock_zero_ns += 1'073'741'824'000;
        EXPECT_NEAR(double(device.next(1 + lag_ms).late_ns) * 1e-6, lag_ms, 1);
        EXPECT_NEAR(double(device.next(1 + lag_ms).late_ns) * 1e-6, lag_ms, 1);
    }
}

// The clock counts a prime number of ms. Its first end looks as if the clock was set back.
TEST(StreamAge, AClockOfAnotherPeriodShowsALagThatBeginsAtItsEnd) {
    constexpr std::uint64_t kPeriod = 65'521 * kMs;
    for (const bool counter : {true, false}) {
        Device device(network(), true, counter);
        device.clock_zero_ns = device.measured_ns;
        device.run(6552);
        device.clock_zero_ns += kPeriod;
        device.run(6551);
        EXPECT_LT(device.next().late_ns, 30 * kMs);
        device.clock_zero_ns += kPeriod;
        for (int i = 0; i < 500; ++i) ASSERT_NEAR(double(device.next(3000).late_ns) * 1e-6, 2999, 60) << counter << i;
        EXPECT_LT(device.next(1, 3010).late_ns, 60 * kMs);
        device.run(100);
        device.run(100, 2000);  // after it, too, a silence and a small number of the clock are no restart
        EXPECT_GT(device.next(2000).late_ns, 1900 * kMs);
    }
}

TEST(StreamAge, AClockThatGoesBackInASilenceWhileTheCounterGoesOnLeavesTheAgeUnproved) {
    Device device(network());
    device.clock_zero_ns = device.measured_ns - 60 * kS;
    device.run(552);
    device.clock_zero_ns += 65'521 * kMs;  // for the first time: nothing shows whether the silence was a pause
    for (int i = 0; i < 500; ++i) {
        const Frame frame = device.next(3000);
        ASSERT_TRUE(frame.age == Age::unproved || frame.late_ns > 1000 * kMs) << i;
    }
}

TEST(StreamAge, AClockThatIsSetBackInALagTwiceStaysAsLateAsItWas) {
    Device device(network());
    device.run(1000);
    device.run(100, 2000);
    for (int i = 0; i < 2; ++i) {
        device.clock_zero_ns += 5 * kS;
        device.run(50, 2000);
    }
    device.run(300, 2000);
    EXPECT_NEAR(double(device.next(2000).late_ns) * 1e-6, 1999, 15);
    EXPECT_LT(device.next(1, 2010).late_ns, 15 * kMs);
}

// The second time comes before it is known that the first one was no ring of old frames: 22 s.
TEST(StreamAge, ALagThatBeginsBetweenTwoTimesAtWhichAClockIsSetBackIsSeen) {
    Device device(network(), true, false);
    device.run(1000);
    for (const double lag_ms : {1.0, 2000.0}) {
        device.clock_zero_ns += 20 * kS;
        device.run(500, lag_ms);
        device.run(100, 2000);
    }
    for (int i = 0; i < 5000; ++i) ASSERT_GT(double(device.next(2000).late_ns) * 1e-6, 1950) << i;
    EXPECT_LT(device.next(1, 2010).late_ns, 60 * kMs);
}

TEST(StreamAge, AFrameThatWasOvertakenBeforeASilenceIsNoClockThatWasSetBack) {
    Device device(network(), true, false);
    device.run(1000);
    device.measured_ns -= 500 * kMs;
    EXPECT_NEAR(double(device.next(500).late_ns) * 1e-6, 499, 15);
    device.measured_ns += 490 * kMs;
    for (int i = 0; i < 50; ++i) EXPECT_NEAR(double(device.next(5000).late_ns) * 1e-6, 4999, 15);
    EXPECT_NEAR(double(device.next(450, 4560).late_ns) * 1e-6, 449, 15);
}

// A device that runs for about a minute each time has no period: its frames would seem to be late.
TEST(StreamAge, ADeviceThatRestartsAgainAndAgainHasNoPeriod) {
    for (const Route& route : {network(), connection()}) {
        Device device(route, true, false);
        for (const int frames : {5700, 5800, 5900, 5750, 5850}) {
            device.measured_ns += 3 * kS;
            device.clock_zero_ns = device.measured_ns - 50 * kMs;
            device.run(100);
            device.open(route);
            device.run(frames);
            const Frame frame = device.next();
            EXPECT_EQ(frame.age, Age::proved) << frames;
            EXPECT_LT(frame.late_ns, 100 * kMs) << frames;
        }
    }
}

// The clock is 1 % faster than the machine's, and 200 ppm are stated: it would hide a lag of a second within 100 s.
TEST(StreamAge, AClockThatIsFasterThanStatedProvesNothingUntilItsRateIsLearnedOverANewConnection) {
    for (const bool discards : {false, true}) {
        Device device(discards ? connection() : network());
        const auto next = [&](double delay_ms = 1, double period_ms = 10) {
            device.clock_zero_ns -= std::uint64_t(period_ms * 1e4);
            return device.next(delay_ms, period_ms);
        };
        for (int i = 0; i < 800; ++i) (void)next();
        ASSERT_EQ(next().age, Age::unproved);
        if (!discards) continue;
        device.open(connection());
        ASSERT_EQ(next(1, 210).age, Age::proved);
        for (int i = 0; i < 20'000; ++i) ASSERT_EQ(next().age, Age::proved) << i;
        for (int i = 0; i < 20'000; ++i) ASSERT_GT(next(1000).late_ns, 500 * kMs) << i;
    }
}

// Timers count half microseconds, tenths, or nanoseconds. Each frame would be the earliest one of all.
TEST(StreamAge, AClockThatCountsInAnotherUnitProvesNothing) {
    for (const int scale : {2, 10, 1000})
        for (const double period_ms : {200.0, 10.0}) {
            Device device(connection());
            device.clock_scale = scale;
            for (int i = 0; i < 3000; ++i) (void)device.next(1, period_ms);
            for (int i = 0; i < 300; ++i)
                ASSERT_EQ(device.next(3000, period_ms).age, Age::unproved) << scale << period_ms << i;
            for (int i = 0; i < 2; ++i) {  // the first time, it may still be that of a resonator
                device.open(connection());
                (void)device.next(1, 3000 + period_ms);
                for (int k = 0; k < 300; ++k) (void)device.next(1, period_ms);
                ASSERT_EQ(device.next(1, period_ms).age, Age::unproved) << scale << period_ms << i;
            }
            device.open(connection());
            EXPECT_EQ(device.next(1, 300).age, Age::unproved) << scale << period_ms;
        }
}

TEST(StreamAge, AClockThatIsSetOnNowAndThenIsAClock) {
    Device device(network());
    for (int i = 0; i < 30; ++i) {
        device.clock_zero_ns -= 5 * kS;
        device.run(6500);
        ASSERT_EQ(device.next().age, Age::proved) << i;
    }
}

// The path keeps its frames while it is closed. Meanwhile the clock is set, or another device takes its place.
TEST(StreamAge, AClockThatIsSetOnWhileTheLinkIsClosedInALagLeavesTheAgeUnproved) {
    for (const Route& route : {network(), connection()}) {
        Device device(route);
        device.run(1000);
        device.run(300, 2000);
        device.open(route);
        device.clock_zero_ns -= 5 * kS;
        for (int i = 0; i < 100; ++i) ASSERT_EQ(device.next(2000).age, Age::unproved) << i;
    }
}

// A virtual machine. The frames of the time in which its clocks stood still come one right after the other.
TEST(StreamAge, FramesThatCameWhileTheHostsClockStoodStillAreNotProvedUntilTheyAreOver) {
    for (const bool clock : {true, false}) {
        Device device(network(), clock);
        device.run(1000);
        int proved = 0;
        double delay_ms = 1;
        for (int i = 0; i < 1000; ++i) proved += device.next(delay_ms -= 10).age == Age::proved;
        EXPECT_LE(proved, 6) << "those of the first 50 ms";
        for (int i = 0; i < 6; ++i) (void)device.next(delay_ms);
        for (int i = 0; i < 1000; ++i) ASSERT_EQ(device.next(delay_ms).age, Age::proved) << i;
        EXPECT_GT(device.next(delay_ms + 200).late_ns + (clock ? 0 : kS), 150 * kMs);
    }
}

}  // namespace
}  // namespace tactiled
