// Devices whose rate, clock or counter changes.
#include <gtest/gtest.h>

#include "delayed_device.hpp"

namespace tactiled {
namespace {

// The device sends 10 % more frames a second. The counter then seems to catch up with a lag that is still there.
TEST(StreamAge, ACounterOfADeviceThatGotFasterProvesNothing) {
    Device device(network(), false);
    device.run(3000);
    for (int i = 0; i < 110; ++i) (void)device.next(1, 9);
    for (int i = 0; i < 5000; ++i) ASSERT_EQ(device.next(2000, 9).age, Age::unproved) << i;
    Device opened(connection(), false);
    opened.run(3000);
    for (int i = 0; i < 110; ++i) (void)opened.next(1, 9);
    ASSERT_EQ(opened.next(1, 9).age, Age::unproved);
    opened.open(connection());
    opened.sequence += 22;
    ASSERT_EQ(opened.next(1, 200).age, Age::proved) << "its rate is measured anew";
    for (int i = 0; i < 3000; ++i) ASSERT_EQ(opened.next(1, 9).age, Age::proved) << i;
    for (int i = 0; i < 5000; ++i) ASSERT_EQ(opened.next(2000, 9).age, Age::unproved) << i;
}

TEST(StreamAge, ADeviceThatGetsFasterInALagHasNotCaughtUp) {
    Device device(network(), false);
    device.run(3000);
    device.run(10, 1000);
    for (int i = 0; i < 5000; ++i) ASSERT_EQ(device.next(1000, 9).age, Age::unproved) << i;
}

TEST(StreamAge, ALagThatIsCaughtUpEvenlyIsOverWhenTheRateIsAsBefore) {
    Device device(network(), false);
    device.run(3000);
    for (double delay_ms = 1000; delay_ms > 1; --delay_ms) {
        const Frame frame = device.next(delay_ms);
        if (delay_ms > 30) { ASSERT_EQ(frame.age, Age::unproved) << delay_ms; }
    }
    device.run(200);
    EXPECT_EQ(device.next().age, Age::proved);
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
            EXPECT_EQ(device.next(1, 2210).age, Age::proved);
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

}  // namespace
}  // namespace tactiled
