// Devices whose rate changes, without a clock.
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "delayed_device.hpp"
#include "drivers/wire/reopening_pace.hpp"

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
    ASSERT_EQ(opened.reopened(200, 1, 9).age, Age::proved) << "its rate is measured anew";
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

}  // namespace
}  // namespace tactiled
