// The bound of the age: what makes it grow, what makes it small again, and what begins again.
#include <gtest/gtest.h>

#include <utility>

#include "delayed_device.hpp"

namespace tactiled {
namespace {

// ---- the bound grows -----------------------------------------------------------------------------------------------------

TEST(StreamAge, TheBoundGrowsByTheDriftOfTheClocksUntilAProof) {
    for (const bool clock : {true, false}) {
        Device device(network(), clock);
        const double first_ns = device.next().bound_ns;
        device.run(10'000);  // 100 s at 200 ppm
        EXPECT_NEAR(device.next().bound_ns - first_ns, 20e6, 1e6);
        device.run(40'000);
        EXPECT_EQ(device.next().age, Age::unproved);
        Frame frame = device.next();
        frame.asked_ns = 1;
        frame.answered_us = std::uint32_t(frame.device_time_us);
        ++frame.sequence;
        ++device.sequence;
        device.age.judge(frame, frame.taken_ns, frame.taken_ns - 3 * kMs);
        EXPECT_EQ(frame.age, Age::proved) << "an echo";
        EXPECT_LE(frame.bound_ns, 3.1e6);
    }
}

TEST(StreamAge, AGrowingQueueWithinTheDriftIsUncertainBeforeItIsOld) {
    Device device(network());
    double delay_ms = 1;
    for (int i = 0; i < 200'000; ++i, delay_ms += 0.0019) {
        device.clock_zero_ns -= 1900;  // the device's clock is 190 ppm fast, so its time and its rate look perfect
        const Frame frame = device.next(delay_ms);
        ASSERT_FALSE(frame.age == Age::proved && frame.late_ns < 100 * kMs && delay_ms > 150) << i;
    }
    EXPECT_FALSE(device.age.may_ask());
}

TEST(StreamAge, FramesAreProvedByTheFirstOpeningAndABoundOfHalfOfStaleAsksForTheNext) {
    Device device(connection());
    EXPECT_EQ(device.next().age, Age::unproved) << "they may have waited before the start";
    device.run(10);
    EXPECT_TRUE(device.age.asks_for_reopening(device.measured_ns, true));
    device.reopen();
    EXPECT_EQ(device.next().age, Age::proved);
    device.run(100);
    EXPECT_FALSE(device.age.asks_for_reopening(device.measured_ns, false));
    device.run(24'000);
    EXPECT_TRUE(device.age.asks_for_reopening(device.measured_ns, false));
    EXPECT_FALSE(device.age.asks_for_reopening(device.measured_ns, true)) << "an object is held";
    device.run(10'000);
    EXPECT_TRUE(device.age.asks_for_reopening(device.measured_ns, true));
}

// ---- proofs --------------------------------------------------------------------------------------------------------------

TEST(StreamAge, AnOpeningProvesOnlyIfTheFramesOfTheClosedTimeAreMissing) {
    for (const bool clock : {true, false})
        for (const bool keeps : {true, false}) {
            Device device(connection(), clock);
            device.run(100);
            device.reopen();
            device.run(30'000);
            const double before_ns = device.next().bound_ns;
            device.reopen(100, keeps);
            const Frame frame = device.next(keeps ? 101 : 1);
            if (keeps)
                EXPECT_GT(frame.bound_ns, clock ? before_ns + 50e6 : 1e12) << clock;
            else
                EXPECT_LT(frame.bound_ns, 12e6) << clock;
        }
}

TEST(StreamAge, AGatewayThatKeepsAFullQueueIsNotProvedByOpeningItAgain) {
    Device device(connection());
    device.run(10);
    device.reopen();
    device.run(30'000);
    double delay_ms = 1;
    for (int i = 0; i < 20; ++i) {
        device.age.open(connection(), device.measured_ns + std::uint64_t(delay_ms * 1e6) + 100 * kMs);
        if (delay_ms < 1000)
            delay_ms += 100;
        else {
            device.measured_ns += 100 * kMs;  // it drops the oldest ones
            device.sequence += 10;
        }
        device.run(50, delay_ms);
        const Frame frame = device.next(delay_ms);
        ASSERT_FALSE(frame.age == Age::proved && frame.late_ns < 100 * kMs && delay_ms > 150) << i;
    }
}

TEST(StreamAge, TwoProofsMeasureTheRateOfAResonator) {
    Device device(connection());
    device.run(10);
    device.reopen();
    for (int minute = 0; minute < 20; ++minute) {
        for (int i = 0; i < 2000; ++i) {
            device.clock_zero_ns += 30'000;  // 0.3 % slow, and 200 ppm are declared
            (void)device.next();
        }
        device.age.open(connection(), device.measured_ns + 50 * kMs);
        device.measured_ns += 50 * kMs;
        device.clock_zero_ns += 150'000;
        device.sequence += 5;
        const Frame frame = device.next();
        if (minute > 1) {
            EXPECT_EQ(frame.age, Age::proved) << minute;
            EXPECT_LT(frame.late_ns, 50 * kMs) << minute;
        }
    }
    EXPECT_NEAR(device.age.rate_error(), 0.003, 1e-4);
}

TEST(StreamAge, ARequestIsProofInItself) {
    Device device({.path = Path::polled}, false, false);
    device.run(10);
    const Frame frame = device.next(1, 5000);
    EXPECT_EQ(frame.age, Age::proved);
    EXPECT_EQ(frame.late_ns, 0u);
    EXPECT_EQ(device.age.proof(), StreamAge::Proof::polled);
}

// The answer lay there while the thread was starved, or came late: the value may be as old as the request.
TEST(StreamAge, AnAnswerThatTookLongerMayBeOlderThanItsReading) {
    StreamAge age(100 * kMs);
    age.open({.path = Path::polled});
    for (const unsigned took_ms : {5u, 49u, 60u, 2000u}) {
        Frame frame;
        frame.t_ns = frame.taken_ns = 10 * kS;
        frame.since_ns = frame.t_ns - took_ms * kMs;
        age.judge(frame, frame.taken_ns);
        EXPECT_EQ(frame.late_ns, took_ms > 50 ? (took_ms - 50) * kMs : 0) << took_ms;
        EXPECT_EQ(frame.t_ns, 10 * kS - frame.late_ns) << took_ms;
    }
}

// ---- a lag, a pause ------------------------------------------------------------------------------------------------------

TEST(StreamAge, ALagIsMeasuredByTheClockAndEndsWithIt) {
    Device device(network());
    device.run(1000);
    EXPECT_NEAR(double(device.next(2000).late_ns), 1999e6, 1e6);
    for (double delay_ms = 1990; delay_ms > 1; delay_ms -= 10) (void)device.next(delay_ms);
    const Frame frame = device.next();
    EXPECT_EQ(frame.age, Age::proved);
    EXPECT_LT(frame.late_ns, kMs);
    EXPECT_EQ(device.next(1, 2000).age, Age::proved) << "a device that pauses";
}

TEST(StreamAge, WithoutAClockAPauseIsADoubtUntilTheMissingFramesComeOrAnOpening) {
    for (const bool counter : {true, false}) {
        Device device(connection(), false, counter);
        device.run(200);
        device.reopen();  // its interval is measured
        device.run(100);
        for (int i = 0; i < 50; ++i) {
            const Age age = device.next(501 - 10 * i).age;
            EXPECT_TRUE((i >= 38 && i <= 44) || (age == Age::unproved) == (i < 40)) << i;
        }
        EXPECT_EQ(device.next(1, 2000).age, Age::unproved);
        EXPECT_EQ(device.next().age, Age::unproved);
        EXPECT_FALSE(device.age.asks_for_reopening(device.measured_ns, false));
        device.run(6);
        EXPECT_TRUE(device.age.asks_for_reopening(device.measured_ns, false));
        device.reopen(100);
        EXPECT_EQ(device.next().age, counter ? Age::proved : Age::arrival_only);
    }
}

// The gateway discards what it has; a backlog before it remains, and drains.
TEST(StreamAge, ABacklogBeforeTheGatewayIsNotProvedUntilItHasDrained) {
    Device device(connection());
    device.run(10);
    device.reopen();
    device.run(100);
    for (double delay_ms = 2000; delay_ms > 80; delay_ms -= 1) {
        if (int(delay_ms) % 100 == 0) device.reopen();
        const Frame frame = device.next(delay_ms);
        ASSERT_FALSE(frame.age == Age::proved && frame.late_ns < 100 * kMs && delay_ms > 150) << delay_ms;
    }
    device.run(10);
    device.reopen();
    EXPECT_EQ(device.next().age, Age::proved);
}

TEST(StreamAge, ABacklogAtTheStartIsNotProvedByAnAnswerThatIsAsLate) {
    Device device({.path = Path::network, .device_clock = true, .has_echo = true});
    const auto answered = [&](double delay_ms, double period_ms = 10) {
        Frame frame = device.next(delay_ms, period_ms);
        frame.asked_ns = 1;
        frame.answered_us = std::uint32_t(frame.device_time_us);
        ++frame.sequence;
        ++device.sequence;
        device.age.judge(frame, frame.taken_ns, frame.taken_ns - std::uint64_t(delay_ms * 1e6));
        return frame;
    };
    for (int i = 0; i < 100; ++i) ASSERT_EQ(answered(1000).age, Age::unproved) << i;
    EXPECT_EQ(answered(2, 1010).age, Age::proved);
}

// The frames that end a pause come faster than the device measures. If some of them counted as its rate, x would rise.
TEST(StreamAge, AQueueThatWasReleasedLeavesNoDoubt) {
    for (const bool counter : {true, false}) {
        Device device(network(), false, counter);
        device.run(155);
        for (int i = 0; i < 100; ++i) {
            const Frame frame = device.next(1000 - 10 * i);
            if (i < 85) { ASSERT_EQ(frame.age, Age::unproved) << i; }
        }
        for (int i = 0; i < 2000; ++i) ASSERT_NE(device.next().age, Age::unproved) << i;
    }
}

TEST(StreamAge, AStopOfThisProcessIsNoLagOfThePath) {
    for (const bool counter : {true, false}) {
        Device device(network(), false, counter);
        device.run(1000);
        Frame frame;
        device.measured_ns += 500 * kMs;
        frame.t_ns = frame.taken_ns = device.measured_ns + kMs;
        frame.since_ns = frame.taken_ns - 490 * kMs;
        frame.has_sequence = counter;
        frame.sequence = device.sequence++;
        device.age.judge(frame, frame.taken_ns);
        EXPECT_EQ(frame.late_ns, 490 * kMs);
        EXPECT_NE(device.next().age, Age::unproved);
    }
}

// ---- openings that prove nothing, or less
// -----------------------------------------------------------------------------------

TEST(StreamAge, AfterAnOutageTheGatewayMayHaveKeptTheLastFrames) {
    Device device(connection(), false);
    device.run(100);
    device.reopen();
    device.run(100);
    device.open(connection());
    device.measured_ns += 20 * kS;  // closed for 30 s, and the last 10 s are kept
    device.sequence += 2000;
    for (int i = 0; i < 1000; ++i) ASSERT_NE(device.next(10'000).age, Age::proved) << i;
    EXPECT_TRUE(device.age.asks_for_reopening(device.measured_ns + 10 * kS, false));
    device.measured_ns += 10 * kS;
    device.sequence += 1000;
    device.reopen();
    EXPECT_EQ(device.next().age, Age::proved);
}

TEST(StreamAge, AGatewayThatKeepsItsLastFramesIsProvedByTheirNumbersAlone) {
    for (const bool clock : {true, false}) {
        Device device(connection(), clock);
        device.run(100);
        device.age.open(device.path, device.measured_ns + 100 * kMs);
        device.measured_ns += 50 * kMs;  // it has kept the last five
        device.sequence += 5;
        EXPECT_EQ(device.next(45).age, clock ? Age::unproved : Age::proved) << clock;
    }
}

TEST(StreamAge, APathThatKeptFramesOnceIsProvedAgain) {
    Device device(connection());
    device.run(100);
    device.reopen();
    device.run(100);
    device.run(40, 150);  // this machine is busy
    device.age.open(device.path, device.measured_ns + 200 * kMs);
    device.measured_ns += 50 * kMs;  // the first frame was measured before the middle of the closed time
    device.sequence += 5;
    (void)device.next(145);
    bool asks = false;
    for (int i = 0; i < 100 && !asks; ++i) {
        (void)device.next();
        asks = device.age.asks_for_reopening(device.measured_ns, false);
    }
    EXPECT_TRUE(asks);
    device.run(800);
    device.reopen();
    (void)device.next();
    device.run(30'000);  // 300 s
    device.reopen();
    EXPECT_EQ(device.next().age, Age::proved);
    EXPECT_LT(device.next().bound_ns, 12e6);
}

TEST(StreamAge, APauseBetweenTwoProofsDoesNotStretchTheInterval) {
    Device device(connection(), false);
    for (int i = 0; i < 10; ++i) {
        device.run(500);
        device.reopen();
    }
    device.run(250);
    (void)device.next(1, 1000);
    device.run(250);
    device.reopen();
    double delay_ms = 1;
    for (int i = 0; i < 3000; ++i, delay_ms += 1)  // the queue grows by 10 %
        ASSERT_FALSE(device.next(delay_ms).age == Age::proved && delay_ms > 150) << i;
}

TEST(StreamAge, ADeviceThatPausesWhileTheLinkIsClosedProvesNothingByItsNumbers) {
    Device device(connection());
    device.run(100);
    device.reopen();
    device.run(100);
    const double before_ns = device.next(40).bound_ns;
    device.reopen(50, true);
    EXPECT_GE(device.next(40, 60).bound_ns, before_ns - 1e6);
    device.reopen();
    EXPECT_LT(device.next().bound_ns, 12e6);
}

TEST(StreamAge, ALongerWayIsProvedByAnOpening) {
    Device device(connection());
    device.run(100);
    device.reopen();
    device.run(100);
    device.run(1000, 95);
    EXPECT_EQ(device.next(95).age, Age::unproved);
    device.reopen();
    EXPECT_EQ(device.next(20).age, Age::proved);
    EXPECT_EQ(device.next(20).age, Age::proved);
}

TEST(StreamAge, AStreamThatLosesItsClockIsProvedByItsNumbers) {
    Device device(connection());
    device.run(100);
    device.reopen();
    device.run(100);
    device.has_clock = false;
    EXPECT_EQ(device.next().age, Age::proved) << "no silence";
    device.run(1000);
    EXPECT_EQ(device.next().age, Age::unproved);
    device.reopen();
    EXPECT_EQ(device.next().age, Age::proved);
}

// ---- begin again ---------------------------------------------------------------------------------------------------------

TEST(StreamAge, ARestartIsKnownAsWellAsItsSilence) {
    for (const std::uint64_t silence_ms : {20u, 2000u}) {
        Device device(network());
        device.run(1000);
        device.measured_ns += silence_ms * kMs;
        device.clock_zero_ns = device.measured_ns;
        const Frame frame = device.next();
        EXPECT_EQ(frame.age, silence_ms < 100 ? Age::proved : Age::unproved);
        EXPECT_NEAR(frame.bound_ns, double(silence_ms) * 1e6, 30e6);
    }
}

TEST(StreamAge, AClockThatLeapsIsADoubtAsLargeAsItsLeap) {
    Device device(network());
    device.run(1000);
    device.clock_zero_ns -= 30 * kMs;
    EXPECT_EQ(device.next().age, Age::proved);
    device.clock_zero_ns -= 500 * kMs;
    EXPECT_EQ(device.next().age, Age::unproved);
    device.clock_zero_ns += 2000 * kMs;  // set back: the frames seem to be old
    EXPECT_GT(device.next().late_ns, 1000 * kMs);
}

TEST(StreamAge, AClockInAnotherUnitProvesNothing) {
    Device device(network());
    device.clock_scale = 10;
    device.run(100);
    EXPECT_EQ(device.next().age, Age::unproved);
}

TEST(StreamAge, AClockOf30BitsGoesOn) {
    Device device(network());
    device.measured_ns = 1'000'000 * kMs;
    device.clock_zero_ns = device.measured_ns - 1'073'000 * kMs;
    for (int i = 0; i < 500; ++i) {
        if (device.measured_ns - device.clock_zero_ns > 1'073'741'824'000) device.clock_zero_ns += 1'073'741'824'000;
        ASSERT_EQ(device.next().age, Age::proved) << i;
    }
}

// ---- cables --------------------------------------------------------------------------------------------------------------

TEST(StreamAge, ACableBoundsTheDelayAndADeviceOnItMayPause) {
    for (const bool counter : {true, false}) {
        Device device({.path = Path::direct, .is_assumed = !counter}, false, counter);
        device.run(100);
        EXPECT_EQ(device.next(1, 5000).age, Age::proved);
        Frame frame;
        frame.t_ns = frame.taken_ns = device.measured_ns + 930 * kMs;
        frame.since_ns = device.measured_ns + 10 * kMs;  // the process was stopped: it may have come right after that
        device.age.judge(frame, frame.taken_ns);
        EXPECT_EQ(frame.t_ns, frame.since_ns);
        EXPECT_EQ(frame.late_ns, 920 * kMs);
    }
}

// Its bytes may have come at any time of the wait, and no stop of the process shows when.
TEST(StreamAge, AFrameOfACableAfterAWaitLongerThanStaleMsIsNotProved) {
    Device device({.path = Path::direct}, false, false);
    device.run(100);
    for (const std::uint64_t waited_ms : {60u, 250u}) {
        Frame frame;
        frame.t_ns = frame.taken_ns = device.measured_ns + 930 * kMs;
        frame.since_ns = frame.taken_ns - waited_ms * kMs;
        frame.slice_ns = 250 * kMs;  // an ordinary wait
        device.age.judge(frame, frame.taken_ns);
        EXPECT_EQ(frame.age, waited_ms == 60 ? Age::proved : Age::unproved) << waited_ms;
        EXPECT_EQ(frame.late_ns, 0u) << waited_ms;
        EXPECT_EQ(frame.bound_ns, double(waited_ms * kMs)) << waited_ms;
    }
}

TEST(StreamAge, ShortPausesOfADeviceWithoutAClockAreNoLagOfAPortOfThisMachine) {
    Device device({.path = Path::direct, .is_assumed = true}, false);
    for (int i = 0; i < 10'000; ++i) ASSERT_EQ(device.next(1, i % 500 == 499 ? 50 : 10).age, Age::proved) << i;
}

// A radio behind a local port sends the same bytes as a device that pauses on a cable.
TEST(StreamAge, APortOfThisMachineIsACableAsLongAsNumbersAndRateAgree) {
    Device device({.path = Path::direct, .device_clock = true, .is_assumed = true}, false);
    device.run(1000);
    for (int i = 0; i < 1000; ++i) ASSERT_EQ(device.next(2000).age, Age::unproved) << i;
    for (double delay_ms = 1990; delay_ms > 1; delay_ms -= 10) (void)device.next(delay_ms);
    EXPECT_EQ(device.next().age, Age::proved);
}

TEST(StreamAge, AResonatorOnACableIsNotLateAndAStopOfTheProcessIsSeenByTheClock) {
    Device device(cable());
    for (int i = 0; i < 100'000; ++i) {
        device.clock_zero_ns += 50'000;  // 0.5 % slow
        ASSERT_LT(device.next().late_ns, 50 * kMs) << i;
    }
    Frame frame;
    device.measured_ns += 500 * kMs;
    frame.t_ns = frame.taken_ns = device.measured_ns + kMs;
    frame.since_ns = frame.t_ns - 400 * kMs;
    device.clock_zero_ns += 2'500'000;
    frame.device_time_us = (device.measured_ns - device.clock_zero_ns) / 1000;
    device.age.judge(frame, frame.taken_ns);
    EXPECT_LT(frame.late_ns, 50 * kMs);
}

// A held frame is late; what stays so for half a second on a cable that the user declares is another offset.
TEST(StreamAge, ADeclaredCableWhoseClockWasSetBackIsGoodAgain) {
    for (const bool is_assumed : {true, false}) {
        Device device({.path = Path::direct, .device_clock = true, .is_assumed = is_assumed});
        device.run(1000);
        EXPECT_GT(device.next(210).late_ns, 100 * kMs);
        for (double delay_ms = 200; delay_ms > 110; delay_ms -= 10) EXPECT_GT(device.next(delay_ms).late_ns, 100 * kMs);
        device.run(100);
        device.has_sequence = false;
        device.clock_zero_ns += 300 * kMs;
        device.measured_ns += 300 * kMs;
        EXPECT_NE(device.next(300).late_ns, 0u);
        device.run(60, 300);
        EXPECT_EQ(device.next(300).age == Age::proved && device.next(300).late_ns == 0, !is_assumed);
    }
}

TEST(StreamAge, ACableWhoseClockCountsInAnotherUnitIsBoundByItsBuffers) {
    Device device(cable());
    device.clock_scale = 10;
    device.run(1000);
    EXPECT_EQ(device.next().age, Age::proved);
    Frame frame;
    frame.t_ns = frame.taken_ns = device.measured_ns + 900 * kMs;
    frame.since_ns = device.measured_ns;  // the process was stopped
    frame.device_time_us = (device.measured_ns - device.clock_zero_ns) / 100 + 9000;
    device.age.judge(frame, frame.taken_ns);
    EXPECT_TRUE(frame.age == Age::unproved || frame.late_ns > 100 * kMs);
}

// ---- order and repetition ------------------------------------------------------------------------------------------------

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

TEST(StreamAge, AServerThatSendsItsLastFrameToEachNewClientProvesNothing) {
    for (const bool counter : {true, false}) {
        Device device(connection(), true, counter);
        device.run(100);
        const Frame last = device.next();
        for (int i = 0; i < 5; ++i) {
            device.age.open(connection(), last.taken_ns + kS);
            Frame again = last;
            again.t_ns = again.taken_ns = last.taken_ns + 1001 * kMs;
            device.age.judge(again, again.taken_ns);
            EXPECT_EQ(again.age, Age::unproved);
        }
    }
}

}  // namespace
}  // namespace tactiled
