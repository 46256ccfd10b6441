// The age of frames on a cable, by their times of arrival, by requests, and the rules that all proofs have in common.
#include <gtest/gtest.h>

#include <utility>

#include "delayed_device.hpp"
#include "drivers/wire/reopening_pace.hpp"

namespace tactiled {
namespace {

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
    EXPECT_EQ(counted.reopened(60).age, Age::proved);
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

// The answer lay there while the thread was starved, or came late: the value may be as old as the request.
TEST(StreamAge, AnAnswerThatTookLongerMayBeOlderThanItsReading) {
    StreamAge age(100, 0.2, 100 * kMs);
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

// The device and the link to it lose their power together.
TEST(StreamAge, ALagThatBeginsWhileTheDeviceRestartsIsNotProvedUntilTheConnectionWasOpenedAgain) {
    for (const std::uint64_t uptime_s : {100u, 2500u})  // beyond half of its 32 bits, too
        for (const bool clock : {true, false}) {
            Device device(connection(), clock);
            device.clock_zero_ns = device.measured_ns - uptime_s * kS;
            device.run(3000);
            device.sequence = 0;
            device.measured_ns += 300 * kMs;
            device.clock_zero_ns = device.measured_ns - (uptime_s > 2200 ? 4'294'967'296'000 : 0);
            for (int i = 0; i < 50; ++i) ASSERT_EQ(device.next(2000).age, Age::unproved) << uptime_s << clock << i;
            device.open(connection());
            device.sequence += 220;
            EXPECT_EQ((clock ? device.next(1, 2210) : device.reopened(2210)).age, Age::proved);
        }
}

// Opening the port resets the board.
TEST(StreamAge, ADeviceOnACableThatCountsFromZeroAfterEachOpeningIsProved) {
    Device device(cable(), false);
    for (int i = 0; i < 3; ++i) {
        device.sequence = 0;
        EXPECT_EQ(device.next(1, 3000).age, Age::proved);
        device.run(100);
        device.open(cable());
    }
}

TEST(StreamAge, ACableWhoseClockCountsInAnotherUnitIsBoundByItsBuffers) {
    Device device(cable());
    device.clock_scale = 10;
    device.run(1000);
    Frame frame = device.next();
    EXPECT_EQ(frame.age, Age::proved);
    frame.late_ns = 0;
    frame.t_ns = frame.taken_ns = device.measured_ns + 900 * kMs;
    frame.since_ns = device.measured_ns;  // the process was stopped
    device.age.judge(frame, frame.taken_ns);
    EXPECT_EQ(frame.late_ns, 900 * kMs);
}

}  // namespace
}  // namespace tactiled
