// Stamps of other clocks, in virtual time.
#include "drivers/wire/clock_fit.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>

namespace tactiled {
namespace {

constexpr std::uint64_t kMs = 1'000'000, kSecond = 1'000 * kMs;

TEST(ArrivalTime, IsTheStampOnTheOtherClock) {
    ArrivalTime arrival;
    arrival.seen_empty(90 * kSecond);
    EXPECT_TRUE(arrival.look(100 * kSecond, 5000 * kSecond));
    EXPECT_EQ(arrival.of(5000 * kSecond - 3 * kMs), 100 * kSecond - 3 * kMs);
    EXPECT_EQ(arrival.of(4991 * kSecond), 91 * kSecond);  // the process stood still for 9 s: old, and told so
}

TEST(ArrivalTime, StaysBetweenTheEmptySocketAndNowWhateverTheWallClockDoes) {
    ArrivalTime arrival;
    arrival.seen_empty(100 * kSecond);
    EXPECT_TRUE(arrival.look(100 * kSecond, 5000 * kSecond));
    EXPECT_FALSE(arrival.look(101 * kSecond, 9000 * kSecond));  // set on, by more than an hour
    EXPECT_EQ(arrival.of(5000 * kSecond + 500 * kMs), 100 * kSecond - 10 * kMs);
    EXPECT_TRUE(arrival.look(102 * kSecond, 9001 * kSecond));
    EXPECT_FALSE(arrival.look(103 * kSecond, 1000 * kSecond));  // set back
    EXPECT_EQ(arrival.of(9001 * kSecond + 500 * kMs), 103 * kSecond);
    EXPECT_EQ(arrival.of(0), 100 * kSecond - 10 * kMs);
    EXPECT_EQ(arrival.of(~0ull), 103 * kSecond);
}

// An adapter: clock at a rate of its own from 1970, messages each ms that are held up by up to 2 ms, now and then 10 ms.
class Adapter {
public:
    explicit Adapter(double drift) : drift_(drift) {}
    // Returns {the true time, stamp, arrival}.
    std::array<std::uint64_t, 3> next() {
        sent_ns_ += kMs;
        const std::uint64_t delay_ns = 50'000 + random_() % (random_() % 100 == 0 ? 10 * kMs : 2 * kMs);
        const auto stamp = std::uint64_t(double(sent_ns_) * (1 + drift_)) / 1000 * 1000;  // whole us
        return {sent_ns_, stamp, kStart + sent_ns_ + delay_ns};
    }
    static constexpr std::uint64_t kStart = 7'000 * kSecond;

private:
    std::mt19937_64 random_{1};
    double drift_;
    std::uint64_t sent_ns_ = 0;
};

TEST(ClockFit, IsNeverEarlyAndAtMostDriftAndLeastDelayLate) {
    for (const double drift : {-100e-6, -20e-6, 0.0, 20e-6, 100e-6}) {
        Adapter adapter(drift);
        ClockFit fit;
        std::int64_t earliest_ns = 0, latest_ns = 0;
        for (int n = 0; n < 600'000; ++n) {
            const auto [sent, stamp, arrival] = adapter.next();
            const std::uint64_t t_ns = fit.monotonic_ns(stamp, arrival);
            ASSERT_LE(t_ns, arrival);
            if (n < 1000) continue;
            const auto error_ns = std::int64_t(t_ns - Adapter::kStart - sent);
            earliest_ns = std::min(earliest_ns, error_ns);
            latest_ns = std::max(latest_ns, error_ns);
        }
        EXPECT_GE(earliest_ns, -2'000) << drift;  // the stamp's own us
        EXPECT_LE(latest_ns, 250'000) << drift;   // 50 us is the way's least; the messages themselves were up to 10 ms late
    }
}

TEST(ClockFit, FollowsAClockThatIsSetAnewFromTheNextMessageOn) {
    Adapter adapter(0);
    ClockFit fit;
    for (int n = 0; n < 1000; ++n) {
        const auto [sent, stamp, arrival] = adapter.next();
        (void)fit.monotonic_ns(stamp, arrival);
    }
    for (const std::uint64_t step : {3600 * kSecond, std::uint64_t{0}, 0 - 5 * kSecond}) {
        for (int n = 0; n < 100; ++n) {
            const auto [sent, stamp, arrival] = adapter.next();
            const std::uint64_t t_ns = fit.monotonic_ns(stamp + step, arrival);
            ASSERT_LE(t_ns, arrival);
            ASSERT_LE(arrival - t_ns, 11 * kMs) << step << ' ' << n;
        }
    }
}

TEST(ClockFit, SurvivesAnyStamps) {
    std::mt19937_64 random(3);
    ClockFit fit;
    for (int n = 0; n < 100'000; ++n) (void)fit.monotonic_ns(random(), random());
}

}  // namespace
}  // namespace tactiled
