// The proof of the age by the device's counter.
#include <gtest/gtest.h>

#include "delayed_device.hpp"

namespace tactiled {
namespace {

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
    EXPECT_EQ(device.reopened(10).age, Age::proved);
    device.run(500);
    EXPECT_EQ(device.next().age, Age::proved);
    EXPECT_EQ(device.next(900).age, Age::unproved);
}

// On a busy machine: silences leave the rate unknown for long. The time in which it is not learnt must not make the mean
// interval longer, or one frame would seem to fill the time for which the link was closed.
TEST(StreamAge, ARelayThatKeepsItsFramesIsNotProvedByAnOpeningLongAfterASilenceThatCameBeforeTheRateWasKnown) {
    for (const int frames : {10, 100, 2600}) {
        Device device(connection(), false);
        device.run(5);
        EXPECT_EQ(device.next(900).age, Age::unproved);
        device.run(frames, 900);
        device.open(connection());
        EXPECT_EQ(device.next(1100).age, Age::unproved) << frames << ": the next number, 200 ms later";
        for (int i = 0; i < 100; ++i) ASSERT_EQ(device.next(1100).age, Age::unproved) << frames << ' ' << i;
        device.open(connection());
        device.sequence += 130;
        EXPECT_EQ(device.reopened(1310).age, Age::proved) << frames << ": the frames of 0.2 s and of the lag are missing";
    }
}

// The same with a relay that discards the frames of half the time, because it had no time to look.
TEST(StreamAge, HalfOfTheFramesOfTheTimeForWhichTheLinkWasClosedProveNothingBeforeTheRateIsKnown) {
    Device device(connection(), false);
    device.run(100);
    device.run(100, 900);
    device.open(connection());
    device.sequence += 30;
    EXPECT_EQ(device.next(1150, 310).age, Age::unproved) << "560 ms, of which 250 are missing";
}

// The relay is starved: it accepts the connection late, and then passes on a frame that it held meanwhile.
TEST(StreamAge, AFirstFrameThatTookLongerThanEverProvesNothing) {
    for (const int known : {100, 1000})  // before the rate is known, and after that
        for (const int held_ms : {100, 300, 900}) {
            Device device(connection(), false);
            device.age.open(connection(), device.measured_ns);
            device.run(known);
            device.run(10, held_ms);
            const std::uint64_t opened_ns = device.measured_ns + (held_ms + 200) * kMs;
            device.age.open(connection(), opened_ns);
            device.measured_ns = opened_ns;  // all before was discarded
            device.sequence += 20 + held_ms / 10;
            EXPECT_EQ(device.next(held_ms).age, Age::unproved) << known << ' ' << held_ms;
            device.age.open(connection(), device.measured_ns + (held_ms + 200) * kMs);
            device.measured_ns += (held_ms + 200) * kMs;
            device.sequence += 20 + held_ms / 10;
            device.run(100);  // a known rate shows after a while that nothing is to be caught up
            EXPECT_EQ(device.next().age, Age::proved) << known << ' ' << held_ms;
        }
}

// 20 Hz, stale_ms = 100: three intervals are longer than that.
TEST(StreamAge, ASilenceOfASlowDeviceThatMayBeALagBeyondStaleMsProvesNothingBeforeTheRateIsKnown) {
    StreamAge age(20, 0.2, 100 * kMs);
    std::uint64_t now_ns = 1000 * kS;
    age.open(connection(), now_ns);
    std::uint32_t number = 5000;
    const auto next = [&](std::uint64_t after_ms) {
        Frame frame;
        now_ns += after_ms * kMs;
        frame.t_ns = frame.taken_ns = now_ns;
        frame.has_sequence = true;
        frame.sequence = number++;
        age.judge(frame, now_ns);
        return frame.age;
    };
    for (int i = 0; i < 6; ++i) EXPECT_EQ(next(60), Age::proved) << i;
    EXPECT_EQ(next(155), Age::proved);  // at most 95 ms late
    EXPECT_EQ(next(60), Age::proved);
    EXPECT_EQ(next(170), Age::unproved);
}

// The driver was starved, and opened the link again on its own account. A lag began meanwhile.
TEST(StreamAge, ALagThatBeganWhileTheLinkWasOpenedAgainIsSeenBeforeTheRateIsKnown) {
    for (const Route& route : {network(), connection()}) {
        Device device(route, false);
        device.run(17);
        device.open(route);
        device.sequence += 310;
        EXPECT_EQ(device.next(2000, 3110).age, Age::unproved);
        for (int i = 0; i < 1000; ++i) ASSERT_EQ(device.next(2000).age, Age::unproved) << i;
    }
}

// The relay was starved when the link was closed. It keeps the frames of that time, and passes them on at once.
TEST(StreamAge, FramesThatComeAtOnceAfterAnOpeningWereKept) {
    for (const double declared_Hz : {100, 0})
        for (const int known : {100, 1000}) {
            Device device(connection(), false, true, declared_Hz);
            device.run(known);
            device.run(10, 350);
            device.open(connection());
            device.sequence += 35;
            for (int i = 0; i < 31; ++i) {
                const double delay_ms = 310 - 10 * i;
                EXPECT_EQ(device.next(delay_ms, i == 0 ? 360 : 10).age, Age::unproved) << known << ' ' << delay_ms;
            }
            device.open(connection());
            device.sequence += 30;
            (void)device.reopened(310);
            device.run(100);  // a known rate shows after a while that nothing is to be caught up
            EXPECT_EQ(device.next().age, Age::proved) << known;
        }
}

TEST(StreamAge, ALagThatBeganWhileTheLinkWasDownForLongIsSeenBeforeTheRateIsKnown) {
    Device device(connection(), false, true, 0);
    device.run(100);
    device.open(connection());
    device.sequence += 5499;
    EXPECT_EQ(device.next(5001, 55000).age, Age::unproved);
    for (int i = 0; i < 500; ++i) ASSERT_EQ(device.next(5001).age, Age::unproved) << i;
}

// The device restarts, and a relay is late from then on.
TEST(StreamAge, ARestartWithASilenceBeforeTheRateIsKnownIsNotProved) {
    Device device(connection(), false);
    device.run(100);
    device.sequence = 0;
    EXPECT_EQ(device.next(900).age, Age::unproved);
    for (int i = 0; i < 500; ++i) ASSERT_EQ(device.next(900).age, Age::unproved) << i;
}

// It is read four times as slowly as the link would be closed for a device of 100 Hz.
TEST(StreamAge, TheLinkOfASlowDeviceIsClosedForFourOfItsFramesAlsoBeforeItsRateIsKnown) {
    Device device(connection(), false);
    device.age = StreamAge(2, 0.2, 2000 * kMs);
    device.open(connection());
    (void)device.next(1, 500);
    (void)device.next(1, 500);
    EXPECT_EQ(device.next(2000, 500).age, Age::unproved);
    EXPECT_EQ(device.age.closed_ns(), 2000 * kMs);
    device.open(connection());
    EXPECT_EQ(device.next(3500, 500).age, Age::unproved) << "the next number: nothing was discarded";
}

// A device of 10 Hz. Its first interval looks like a silence.
TEST(StreamAge, ADeviceWithoutADeclaredRateIsProvedByAnOpening) {
    Device device(connection(), false);
    device.age = StreamAge(0, 0.2, 500 * kMs);
    device.open(connection());
    for (int i = 0; i < 10; ++i) (void)device.next(1, 100);
    device.open(connection());
    device.sequence += 4;
    EXPECT_EQ(device.reopened(500, 1, 100).age, Age::proved);
    for (int i = 0; i < 100; ++i) ASSERT_EQ(device.next(1, 100).age, Age::proved) << i;
}

// A server that counts the frames of each connection.
TEST(StreamAge, ACounterOfEachConnectionIsProvedByTwoOpenings) {
    Device device(connection(), false);
    device.age.open(connection(), device.measured_ns);
    device.run(50);
    EXPECT_EQ(device.next(300).age, Age::unproved);
    for (const Age age : {Age::unproved, Age::proved}) {
        device.measured_ns += 300 * kMs;
        device.age.open(connection(), device.measured_ns);
        device.sequence = 0;
        EXPECT_EQ(device.reopened(10).age, age);
    }
}

// The device restarts, or another one takes its place, while the connection is closed for 0.2 s. The path keeps the frames.
TEST(StreamAge, ACounterThatLeapsWhileTheConnectionIsClosedProvesNothing) {
    for (const std::uint32_t before : {5u, 3'000'000'000u})
        for (const std::uint32_t after : {0u, 4'000u, 3'100'000'000u}) {
            Device device(connection(), false);
            device.sequence = before;
            device.run(500);
            device.age.open(connection(), device.measured_ns + 201 * kMs);
            device.sequence = after;
            for (int i = 0; i < 100; ++i) ASSERT_EQ(device.next(220).age, Age::unproved) << before << after << i;
            device.open(connection());
            device.sequence += 21;
            EXPECT_EQ(device.reopened(210 + 220).age, Age::proved);
        }
}

TEST(StreamAge, MissingTimeThatWasCaughtUpIsProof) {
    Device device(network(), false);
    device.run(1000);
    for (int i = 0; i < 200; ++i)  // 2 s of frames arrive together
        ASSERT_EQ(device.next(2000 - 10 * i).age, Age::unproved) << i;
    device.run(5);
    EXPECT_EQ(device.next().age, Age::proved) << "50 ms without a frame that came early";
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

TEST(StreamAge, APathThatKeepsItsFramesWhileItIsClosedIsNotProvedByOpeningItAgain) {
    Device device(connection(), false);
    device.run(1000);
    device.run(100, 2000);
    device.open(connection());
    EXPECT_EQ(device.next(2200).age, Age::unproved) << "the next number, 200 ms later";
    device.open(connection());
    device.sequence += 20;
    EXPECT_EQ(device.reopened(210, 2200).age, Age::proved) << "the frames of 200 ms are missing";
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

// The same, but a part of the lag remains. The rate that shows it needs as long as the lag lasted.
TEST(StreamAge, ALagOfWhichAPartRemainsIsNotOverBeforeTheRateIsKnownWellEnough) {
    Device device(network(), false);
    device.run(400);  // the rate is known for 2 s
    for (int i = 0; i < 1000; ++i) (void)device.next(10'000, 9.9);
    for (double late_ms = 10'000; late_ms > 100; late_ms -= 9.9) (void)device.next(late_ms, 9.9);
    for (int i = 0; i < 500; ++i) ASSERT_EQ(device.next(100, 9.9).age, Age::unproved) << i;
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

// Number 0 may follow lost frames. It may also be that of a device that restarted, while the lag is still there.
TEST(StreamAge, AShortCounterThatSeemsToHaveLostALagHasNotCaughtUp) {
    for (const std::uint8_t bits : {std::uint8_t{8}, std::uint8_t{16}}) {
        Device device(connection(), false);
        device.bits = bits;
        device.sequence = 5;
        device.run(1000);  // up to number 1004
        device.run(100, 2000);
        const std::uint32_t last = (device.sequence - 1) & ((1u << bits) - 1);
        const std::uint32_t end = 1u << bits;
        Frame frame;
        device.measured_ns += 100 * kMs;
        for (std::uint32_t number = 0; number < 100; ++number) {
            device.measured_ns += 10 * kMs;
            frame = Frame{};
            frame.t_ns = frame.taken_ns = device.measured_ns + 2000 * kMs;
            frame.has_sequence = true;
            frame.sequence_bits = bits;
            frame.sequence = number;
            frame.lost = number == 0 ? end - 1 - last : 0;
            device.age.judge(frame, frame.taken_ns);
            ASSERT_EQ(frame.age, Age::unproved) << int(bits) << number;
        }
    }
}

// The range of 7 bits is 1.28 s. The link goes down between the opening and the first frame, which is late by its range.
TEST(StreamAge, AShortCounterDoesNotProveAFirstFrameThatTookLongerThanEver) {
    Device device(connection(), false);
    device.bits = 7;
    device.age.open(connection(), device.measured_ns);
    device.run(1000);
    device.age.open(connection(), device.measured_ns + 200 * kMs);
    device.sequence += 20;
    EXPECT_EQ(device.next(1280, 210).age, Age::unproved);
    for (int i = 0; i < 300; ++i) ASSERT_EQ(device.next(1280).age, Age::unproved) << i;
    device.age.open(connection(), device.measured_ns + 1480 * kMs);
    device.sequence += 147;
    EXPECT_EQ(device.reopened(1480).age, Age::proved);
}

// The server sends the last frame to each new connection.
TEST(StreamAge, TheLastFrameAgainIsNotTheFirstOneOfANewConnection) {
    for (const bool clock : {true, false}) {
        Device device(connection(), clock);
        device.run(1000);
        for (int i = 0; i < 3; ++i) {
            device.open(connection());
            --device.sequence;
            device.clock_zero_ns += 5 * kS;
            EXPECT_EQ(device.next(1, 5000).age, Age::unproved) << i;
        }
        device.clock_zero_ns -= 15 * kS;
        device.sequence += 1500;
        EXPECT_EQ(device.next().age, Age::proved) << "the device is alive";
    }
}

// Counters of two or three digits. A bridge is 3 % slower than the device: no lag grows far before the counter begins again.
TEST(StreamAge, ACounterThatBeginsAgainAtAnyNumberShowsALagThatGrowsSlowly) {
    for (const std::uint32_t period : {16u, 100u, 128u, 1000u}) {
        Device device(network(), false);
        device.counter_period = period;
        for (int i = 0; i < 3000; ++i) { ASSERT_EQ(device.next().age, Age::proved) << period << ' ' << i; }
        for (double delay_ms = 1; delay_ms < 1000; delay_ms += 0.3) {
            const Frame frame = device.next(delay_ms);
            if (delay_ms > 150) { ASSERT_EQ(frame.age, Age::unproved) << period << ' ' << delay_ms; }
        }
    }
}

// Without a checksum. The number of a damaged frame seems to be far ahead, and the next one to begin again.
TEST(StreamAge, DamagedNumbersHideNoLagThatGrowsSlowly) {
    Device device(network(), false);
    device.run(1000);
    double delay_ms = 1;
    for (int i = 0; i < 3000; ++i, delay_ms += 0.3) {
        const std::uint32_t before = device.sequence;
        if (i % 100 == 0) device.sequence += 9000;
        const Frame frame = device.next(delay_ms, 10, i % 100 == 0 ? 9000 : 0);
        if (i % 100 == 0) device.sequence = before + 1;
        if (delay_ms > 150) { ASSERT_EQ(frame.age, Age::unproved) << i << ' ' << delay_ms; }
    }
}

}  // namespace
}  // namespace tactiled
