#include "delayed_device.hpp"
#include "drivers/wire/reopening_pace.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <utility>

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

TEST(StreamAge, ADeviceThatPausesIsProvedByItsClockAtOnceAndByItsCounterWhenTheConnectionWasOpenedAgain) {
    Device clocked(network()), counted(connection(), false), pty(network(), false);
    for (Device* device : {&clocked, &counted, &pty}) device->run(1000);
    EXPECT_EQ(clocked.next(1, 2000).age, Age::proved);
    EXPECT_EQ(counted.next(1, 2000).age, Age::unproved);
    EXPECT_EQ(pty.next(1, 2000).age, Age::unproved);
    for (int i = 0; i < 49; ++i) {
        EXPECT_EQ(counted.next().age, Age::unproved);
        EXPECT_FALSE(counted.age.asks_for_reopening(counted.measured_ns));
    }
    for (int i = 0; i < 3; ++i) EXPECT_EQ(counted.next().age, Age::unproved);
    EXPECT_TRUE(counted.age.asks_for_reopening(counted.measured_ns));
    counted.open(connection());
    counted.sequence += 5;
    EXPECT_EQ(counted.next(1, 60).age, Age::proved);
    pty.run(100);
    EXPECT_FALSE(pty.age.asks_for_reopening(pty.measured_ns));
    pty.open(network());
    pty.sequence += 5;
    EXPECT_EQ(pty.next(1, 60).age, Age::unproved) << "what is behind a pseudo terminal keeps its backlog";
}

// Two frames of one read: the conversion of their common time to the host's clock differs by some ns, in either direction.
TEST(StreamAge, AHostTimeThatGoesBackByTheErrorOfItsReadingIsNoSilence) {
    for (const auto& [clock, counter] : {std::pair{true, true}, {false, true}, {false, false}}) {
        Device device(network(), clock, counter);
        device.run(20);
        const Frame one = device.next();
        Frame two = one;
        ++two.sequence;
        ++device.sequence;
        device.age.judge(two, two.taken_ns - 40);
        EXPECT_NE(two.age, Age::unproved) << clock << counter;
        EXPECT_NE(device.next().age, Age::unproved) << clock << counter;
    }
}

// The rate of the counter is learnt over two seconds. A lag that begins before must not become the reference.
TEST(StreamAge, ASilenceBeforeTheRateIsKnownLeavesACounterUnprovedUntilTheConnectionWasOpenedAgain) {
    Device device(connection(), false);
    device.run(100);
    EXPECT_EQ(device.next(900).age, Age::unproved);
    device.run(500, 900);
    EXPECT_EQ(device.next(900).age, Age::unproved);
    device.measured_ns += kS;
    device.sequence += 100;
    device.open(connection());
    EXPECT_EQ(device.next().age, Age::proved);
    device.run(500);
    EXPECT_EQ(device.next().age, Age::proved);
    EXPECT_EQ(device.next(900).age, Age::unproved);
}

TEST(StreamAge, MissingTimeThatWasCaughtUpIsProof) {
    Device device(network(), false);
    device.run(1000);
    for (int i = 0; i < 200; ++i)  // 2 s of frames arrive together
        ASSERT_EQ(device.next(2000 - 10 * i).age, Age::unproved) << i;
    device.run(5);
    EXPECT_EQ(device.next().age, Age::proved) << "50 ms without a frame that came early";
}

TEST(StreamAge, LateFramesAreNotRelearnedAsOnTimeByOpeningAgain) {
    for (const bool clock : {true, false}) {
        Device device(network(), clock);
        device.run(1000);
        device.run(100, 2000);
        device.open(network());
        const Frame frame = device.next(2000);
        EXPECT_TRUE(frame.age == Age::unproved || frame.late_ns > 1900 * kMs);
    }
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

TEST(StreamAge, ACounterOf16BitsThatPassesItsEndIsNoRestart) {
    Device device(network(), false);
    device.sequence = 65'000;
    device.bits = 16;
    for (int i = 0; i < 2000; ++i) {
        if (device.sequence == 65'536) device.sequence = 0;
        ASSERT_EQ(device.next().age, Age::proved) << i;
    }
    Device late(network(), false);
    late.sequence = 65'536 - 1000;
    late.bits = 16;
    late.run(1000);
    late.sequence = 0;
    EXPECT_EQ(late.next(2000).age, Age::unproved) << "as between any two numbers";
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

TEST(StreamAge, APathThatKeepsItsFramesWhileItIsClosedIsNotProvedByOpeningItAgain) {
    Device device(connection(), false);
    device.run(1000);
    device.run(100, 2000);
    device.open(connection());
    EXPECT_EQ(device.next(2200).age, Age::unproved) << "the next number, 200 ms later";
    device.open(connection());
    device.sequence += 20;
    EXPECT_EQ(device.next(2200, 210).age, Age::proved) << "the frames of 200 ms are missing";
}

TEST(StreamAge, ALagOfWhichOpeningAgainDiscardedAPartIsNotTheNewReference) {
    Device device(connection(), false);
    device.run(1000);
    device.run(100, 2000);
    device.open(connection());
    device.sequence += 211;
    EXPECT_EQ(device.next(90, 2120).age, Age::unproved) << "the rest of the lag";
    for (int i = 0; i < 50; ++i) ASSERT_EQ(device.next(90).age, Age::unproved);
    for (int delay_ms = 81; delay_ms > 1; delay_ms -= 10) (void)device.next(delay_ms);
    device.run(5);
    EXPECT_EQ(device.next().age, Age::proved) << "the missing time was caught up";
}

// The device gets 3 % faster right before a lag of 10 s, which hides 0.3 s of it: a backlog that comes at once is not over
// where the counter and the old rate say so.
TEST(StreamAge, AWrongRateHidesNoPartOfABacklogThatComesAtOnceOrThreeTimesAsFastAsTheDevice) {
    for (const double faster_ms : {9.7, 6.5}) {
        Device device(network(), false);
        device.run(10000);
        for (int i = 0; i < 1000; ++i) (void)device.next(10'000, 9.7);
        for (double late_ms = 10'000; late_ms > 0; late_ms -= faster_ms) {
            const Frame frame = device.next(late_ms, 9.7);
            if (late_ms > 100) { ASSERT_EQ(frame.age, Age::unproved) << late_ms; }
        }
    }
}

// The same, but a part of the lag remains. The rate that shows it needs as long as the lag lasted.
TEST(StreamAge, ALagOfWhichAPartRemainsIsNotOverBeforeTheRateIsKnownWellEnough) {
    Device device(network(), false);
    device.run(400);  // the rate is known for 2 s
    for (int i = 0; i < 1000; ++i) (void)device.next(10'000, 9.9);
    for (double late_ms = 10'000; late_ms > 100; late_ms -= 9.9) (void)device.next(late_ms, 9.9);
    for (int i = 0; i < 500; ++i) ASSERT_EQ(device.next(100, 9.9).age, Age::unproved) << i;
}

// Opens the connection again whenever that is asked for; what was on the way, and the frames of 200 ms, are then missing.
class Reopened {
public:
    Frame next(double delay_ms, double period_ms) {
        const double closed_ms = std::exchange(closes_, false) ? 200 + delay_ms_ : 0;
        const double missing = std::floor(closed_ms / period_ms);
        delay_ms_ = delay_ms;
        device.sequence += std::uint32_t(missing);
        const Frame frame = device.next(delay_ms, (missing + 1) * period_ms);
        closes_ = device.age.asks_for_reopening(frame.taken_ns) && pace_.allows(frame.taken_ns, device.age.trouble_ns());
        if (closes_) device.open(connection());
        return frame;
    }
    [[nodiscard]] bool closes() const { return closes_; }
    Device device{connection(), false};

private:
    ReopeningPace pace_;
    bool closes_ = false;
    double delay_ms_ = 0;
};

TEST(StreamAge, ABridgeThatIsSlowerIsNoDeviceThatGotSlower) {
    Reopened link;
    link.device.run(1000);
    double delay_ms = 1;
    for (int i = 0; i < 6000; ++i) {
        const Frame frame = link.next(delay_ms, 10);
        if (delay_ms > 150) { ASSERT_EQ(frame.age, Age::unproved) << i << ' ' << delay_ms; }
        delay_ms = link.closes() ? 1 : delay_ms + 2;
    }
}

// The rate is measured again: meanwhile a bridge is slower than the device was at its slowest.
TEST(StreamAge, ABridgeThatIsSlowerWhileTheRateOfAFasterDeviceIsMeasuredIsNotProved) {
    Reopened link;
    link.device.run(1000);
    while (!link.closes()) (void)link.next(1, 8);
    double delay_ms = 1;
    for (int i = 0; i < 400; ++i, delay_ms += 3) {
        const Frame frame = link.next(delay_ms, 10);
        if (delay_ms > 150) { ASSERT_EQ(frame.age, Age::unproved) << i << ' ' << delay_ms; }
        if (link.closes()) delay_ms = 1;
    }
}

// Without clock and counter. The first connection's first frame took 1 ms.
TEST(StreamAge, AFirstFrameThatAConnectionHeldIsNotProvedByOpeningItAgain) {
    Device device(connection(), false, false);
    device.age.open(connection(), device.measured_ns);
    device.run(300);
    (void)device.next(1, 200);
    ASSERT_EQ(device.next().age, Age::unproved) << "a silence";
    device.age.open(connection(), device.measured_ns + 200 * kMs);
    EXPECT_EQ(device.next(500, 210).age, Age::unproved) << "the link was down after it had been opened";
    device.age.open(connection(), device.measured_ns + 700 * kMs);
    EXPECT_EQ(device.next(1, 710).age, Age::arrival_only);
}

TEST(ReopeningPace, ALinkIsOpenedAgainAtOnceIfTheLastOpeningHelpedElseLessAndLessOften) {
    ReopeningPace pace;
    std::uint64_t now = 1000 * kS;
    EXPECT_TRUE(pace.allows(now, now - kS));
    EXPECT_FALSE(pace.allows(now + 900 * kMs, now + 500 * kMs));
    EXPECT_TRUE(pace.allows(now + 1100 * kMs, now + 500 * kMs)) << "it has not helped";
    now += 1100 * kMs;
    EXPECT_FALSE(pace.allows(now + 1900 * kMs, now + 300 * kMs)) << "2 s now";
    for (int i = 0; i < 10; ++i) {  // a device that pauses each 7 s
        now += 7 * kS;
        EXPECT_TRUE(pace.allows(now, now - 600 * kMs)) << i;
    }
    unsigned opened = 0;
    std::uint64_t trouble = now;
    for (const std::uint64_t end = now + 3600 * kS; now < end; now += 100 * kMs)
        if (pace.allows(now, trouble)) {
            ++opened;
            trouble = now + 300 * kMs;  // it never helps
        }
    EXPECT_LT(opened, 70u) << "in an hour";
}

TEST(StreamAge, AFrameThatWaitedForTheMachineLeavesACableProved) {
    Device device(cable());
    device.run(1000);
    (void)device.next(600);
    EXPECT_EQ(device.next(1, 3000).age, Age::proved);
}

TEST(StreamAge, WithoutClockAndCounterASilenceEndsTheProofUntilTheConnectionWasOpenedAgain) {
    Device device(connection(), false, false);
    for (int i = 0; i < 100; ++i) EXPECT_EQ(device.next().age, Age::arrival_only);
    EXPECT_EQ(device.next(1, 200).age, Age::unproved);
    EXPECT_EQ(device.next().age, Age::unproved);
    device.open(connection());
    EXPECT_EQ(device.next(1, 60).age, Age::arrival_only);
    EXPECT_EQ(device.next().age, Age::arrival_only);
}

TEST(StreamAge, ACableBoundsTheDelayAndADeviceOnItMayPause) {
    Device device({.path = Path::direct}, false, false);
    device.run(100);
    EXPECT_EQ(device.next(1, 5000).age, Age::proved);
    Frame frame;
    frame.t_ns = frame.taken_ns = device.measured_ns + 930 * kMs;
    frame.since_ns = device.measured_ns + 10 * kMs;  // the process was stopped: it may have come right after that
    device.age.judge(frame, frame.taken_ns);
    EXPECT_EQ(frame.t_ns, frame.since_ns);
    EXPECT_EQ(frame.late_ns, 920 * kMs);
}

TEST(StreamAge, AResonatorOnACableIsNotLateAndAStoppedProcessIsProvedByTheClock) {
    Device device(cable());
    Frame frame;
    for (int i = 0; i < 100'000; ++i) {
        frame = device.next();
        device.clock_zero_ns += 50'000;  // 0.5 % slow
        ASSERT_LT(frame.late_ns, 50 * kMs) << i;
    }
    frame = Frame{};
    device.measured_ns += 500 * kMs;
    frame.t_ns = frame.taken_ns = device.measured_ns + kMs;
    frame.since_ns = frame.t_ns - 400 * kMs;
    device.clock_zero_ns += 2'500'000;
    frame.device_time_us = (device.measured_ns - device.clock_zero_ns) / 1000;
    device.age.judge(frame, frame.taken_ns);
    EXPECT_LT(frame.late_ns, 50 * kMs);
}

TEST(StreamAge, ARequestIsProofInItself) {
    Device device({.path = Path::polled}, false, false);
    device.run(10);
    const Frame frame = device.next(1, 5000);
    EXPECT_EQ(frame.age, Age::proved);
    EXPECT_EQ(frame.late_ns, 0u);
    EXPECT_EQ(device.age.proof(), StreamAge::Proof::polled);
}

}  // namespace
}  // namespace tactiled
