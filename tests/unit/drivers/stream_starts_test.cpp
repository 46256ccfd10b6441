// StreamAge: a lag that begins together with something that makes the device's clock or counter begin anew.
#include "delayed_device.hpp"

namespace tactiled {
namespace {

bool looks_good(const Frame& frame) { return frame.age == Age::proved && frame.late_ns < 100 * kMs; }

// Sends `frames` frames with a delay, of which none may look good.
void expect_seen(Device& device, double delay_ms, int frames = 500) {
    for (int i = 0; i < frames; ++i) ASSERT_FALSE(looks_good(device.next(delay_ms))) << i;
}

// And then the link is opened again, and discards the frames that were on their way.
void expect_seen_until_opened(Device& device, double delay_ms, int openings = 1) {
    expect_seen(device, delay_ms);
    for (int i = 1; i <= openings; ++i) {
        device.open(connection());
        const auto missing = std::uint32_t(20 + (i == 1 ? delay_ms / 10 : 0));
        device.sequence += missing;
        (void)device.next(1, 10 * (missing + 1));
        device.run(10);
        EXPECT_EQ(looks_good(device.next()), i == openings) << i;
    }
}

TEST(StreamAge, ALagThatBeginsWhenTheRateOfTheCounterIsKnownIsSeen) {
    for (int before = 190; before < 215; ++before) {
        SCOPED_TRACE(before);
        Device device(network(), false);
        device.run(before);
        expect_seen(device, 3000);
    }
}

TEST(StreamAge, ALagThatBeginsWhenTheClockIsSetOnIsSeen) {
    for (const bool counter : {true, false})
        for (const auto& [lag_ms, set_on_ms] : {std::pair{800.0, 900.0}, {3000.0, 3100.0}, {3000.0, 100'000.0}}) {
            SCOPED_TRACE(testing::Message() << counter << ' ' << lag_ms << ' ' << set_on_ms);
            Device device(connection(), true, counter);
            device.run(1000);
            device.clock_zero_ns -= std::uint64_t(set_on_ms) * kMs;
            expect_seen_until_opened(device, lag_ms);
        }
}

TEST(StreamAge, AClockThatGoesBackAndThenOnInALagIsSeen) {
    for (const bool counter : {true, false})
        for (const int between : {5, 50, 150}) {
            SCOPED_TRACE(testing::Message() << counter << ' ' << between);
            Device device(network(), true, counter);
            device.run(1000);
            device.run(300, 3000);
            device.clock_zero_ns += 40 * kS;
            expect_seen(device, 3000, between);
            device.clock_zero_ns -= 150 * kS;
            expect_seen(device, 3000);
        }
}

TEST(StreamAge, AnotherDeviceThatTakesOverWithoutASilenceProvesNothing) {
    Device device(connection());
    device.run(1000);
    device.measured_ns -= 2 * kS;  // its frames are so old
    device.clock_zero_ns -= 502 * kS;
    device.sequence += 12345;
    EXPECT_FALSE(looks_good(device.next(2000, 10, 12345)));
    expect_seen_until_opened(device, 2000, 2);
}

TEST(StreamAge, ALagAndAClockThatIsSetOnWhileTheLinkIsClosedAreSeen) {
    for (const bool counter : {true, false}) {
        Device device(connection(), true, counter);
        device.run(1000);
        device.open(connection());
        device.clock_zero_ns -= 100 * kS;
        device.measured_ns += 200 * kMs;
        device.sequence += 20;
        expect_seen_until_opened(device, 2000, 2);
    }
}

// It is not known yet that the clock was set back, and not that old frames came again.
TEST(StreamAge, ALagThatBeginsWhileTheLinkIsClosedAfterTheClockWentBackIsSeen) {
    Device device(connection());
    device.run(1000);
    device.clock_zero_ns += 140 * kS;
    device.run(150);
    device.open(connection());
    device.clock_zero_ns -= 10 * kS;
    device.measured_ns += 200 * kMs;
    device.sequence -= 249;
    expect_seen(device, 4000);
}

TEST(StreamAge, AClockThatBecomesValidInALagProvesNothing) {
    for (const int in_lag : {0, 100}) {  // it may begin with the lag
        SCOPED_TRACE(in_lag);
        Device device(connection(), false);
        device.run(1000);
        device.run(in_lag, 3000);
        device.has_clock = true;
        device.clock_zero_ns = device.measured_ns;
        expect_seen_until_opened(device, 3000, 2);
    }
}

// The reference rises by what the drift may be, and the clock may drift.
TEST(StreamAge, AnHourOfSleepIsNoLeapOfTheClock) {
    for (const bool reopened : {true, false})
        for (const int ahead_ms : {-360, 0, 360}) {  // 100 ppm
            SCOPED_TRACE(testing::Message() << reopened << ' ' << ahead_ms);
            Device device(network());
            device.run(30'000);
            if (reopened) device.open(network());
            device.clock_zero_ns -= std::uint64_t(ahead_ms * std::int64_t(kMs));
            (void)device.next(1, 3'600'000);
            device.run(100);
            EXPECT_TRUE(looks_good(device.next()));
        }
}

// Decoders take a restart in the second half of the clock's 32 bits for its end.
TEST(StreamAge, ARestartAfterHalfOfTheClockIsNoLeap) {
    for (const bool counter : {true, false}) {
        Device device(network(), true, counter);
        device.clock_zero_ns = device.measured_ns - 3000 * kS;
        device.run(1000);
        device.measured_ns += 800 * kMs;
        device.clock_zero_ns = device.measured_ns - 100 * kMs - 4'294'967'296'000;
        device.sequence = 0;
        device.run(10);
        for (int i = 0; i < 100; ++i) ASSERT_TRUE(looks_good(device.next())) << counter << i;
    }
}

TEST(StreamAge, ASlowDeviceWhoseFirstFrameWasHeldIsProved) {
    for (const bool counter : {true, false})
        for (const double period_ms : {100, 200, 500, 1000}) {
            Device device(network(), true, counter, 0);
            (void)device.next(0.6 * period_ms, period_ms);
            (void)device.next(1, period_ms);
            for (int i = 0; i < 100; ++i) EXPECT_TRUE(looks_good(device.next(1, period_ms))) << period_ms << ' ' << i;
        }
}

// It looks as if the clock had passed the end of its 30 or 32 bits in a pause.
TEST(StreamAge, ALagAndARestartNearTheEndOfTheClockAreSeen) {
    for (const bool counter : {true, false})
        for (const std::uint64_t end_ms : {1'073'741u, 4'294'967u})
            for (const unsigned left_ms : {900u, 1500u, 2900u}) {
                SCOPED_TRACE(testing::Message() << counter << ' ' << end_ms << ' ' << left_ms);
                Device device(connection(), true, counter);
                device.clock_zero_ns = device.measured_ns - (end_ms - left_ms) * kMs + 10 * kS;
                device.run(1000);
                device.sequence = 0;
                // The decoders take it for a clock that has passed the end of 32 bits.
                device.clock_zero_ns = device.measured_ns - (end_ms > 2'000'000 ? 4'294'967'296'000 : 0);
                expect_seen_until_opened(device, left_ms + 100.0);
            }
}

// A power cut, and a relay that keeps what it has while the link is closed.
TEST(StreamAge, ALagAndARestartWhileTheLinkIsClosedAreSeen) {
    for (const bool clock : {true, false})
        for (const bool counter : {true, false}) {
            if (!clock && !counter) continue;
            SCOPED_TRACE(testing::Message() << clock << counter);
            Device device(connection(), clock, counter);
            device.run(1000);
            device.open(connection());
            device.measured_ns += 500 * kMs;
            device.clock_zero_ns = device.measured_ns;
            device.sequence = 0;
            expect_seen_until_opened(device, 2000);
        }
}

TEST(StreamAge, AClockWhoseFirstTimeIs0HasRestarted) {
    for (const bool counter : {true, false}) {
        Device device(connection(), true, counter);
        device.run(1000);
        device.clock_zero_ns = device.measured_ns + 10 * kMs;
        device.sequence = 0;
        expect_seen_until_opened(device, 1400);
    }
}

TEST(StreamAge, SmallLagsThatBeginWithEachOfSeveralStartsAddUp) {
    Device device(connection());
    for (int i = 0; i < 9; ++i) {
        device.run(200, 1 + 45 * i);
        device.clock_zero_ns = device.measured_ns;
        device.sequence = 0;
    }
    expect_seen(device, 400);
}

TEST(StreamAge, AnOpeningThatProvesTheAgeForgetsTheStartsBeforeIt) {
    Device device(connection());
    for (int i = 0; i < 3; ++i) {
        device.run(200);
        device.measured_ns += 45 * kMs;
        device.clock_zero_ns = device.measured_ns;
        device.sequence = 0;
        EXPECT_EQ(looks_good(device.next()), i != 1) << i;  // 90 ms in sum
        if (i != 1) continue;
        device.open(connection());
        device.sequence += 20;
        EXPECT_TRUE(looks_good(device.next(1, 210)));
    }
}

// Not the end of its 30 bits: the counter has begun again, too.
TEST(StreamAge, ARestartWithoutASilenceNearTheEndOfTheClockIsSeen) {
    Device device(network());
    device.clock_zero_ns = device.measured_ns - 1'060'000 * kMs;
    device.run(1000);
    device.clock_zero_ns = device.measured_ns;
    device.sequence = 0;
    device.run(100);
    for (int i = 0; i < 100; ++i) ASSERT_FALSE(looks_good(device.next(2000))) << i;
    device.sequence += 200;
    EXPECT_TRUE(looks_good(device.next(1, 2010, 200)));
}

TEST(StreamAge, ALagOfTheRangeOfTheCounterIsSeen) {
    for (const std::uint32_t lost : {0u, 100u}) {
        Device device(network(), false);
        device.bits = 8;
        device.counter_period = 256;
        device.run(1000);
        device.sequence += lost + 256;
        EXPECT_FALSE(looks_good(device.next(2560, 10 * (lost + 1), lost))) << lost;
        expect_seen(device, 2560);
    }
}

}  // namespace
}  // namespace tactiled
