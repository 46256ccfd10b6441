// Timestamps of other clocks, in virtual time.
#include "drivers/wire/clock_fit.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>

namespace tactiled {
namespace {

constexpr std::uint64_t kSecond = 1'000'000'000;

TEST(ArrivalTime, IsTheTimestampOnTheOtherClock) {
    ArrivalTime arrival;
    arrival.seen_empty(90 * kSecond);
    EXPECT_TRUE(arrival.look(100 * kSecond, 5000 * kSecond));
    EXPECT_EQ(arrival.of(5000 * kSecond - 3 * kSecond / 1000), 100 * kSecond - 3 * kSecond / 1000);
    EXPECT_EQ(arrival.of(4991 * kSecond), 91 * kSecond);  // the process was stopped for 9 s: old, and reported as old
}

TEST(ArrivalTime, StaysBetweenTheEmptySocketAndNowWhateverTheWallClockDoes) {
    ArrivalTime arrival;
    arrival.seen_empty(100 * kSecond);
    EXPECT_TRUE(arrival.look(100 * kSecond, 5000 * kSecond));
    EXPECT_FALSE(arrival.look(101 * kSecond, 9000 * kSecond));  // set forward, by more than an hour
    EXPECT_EQ(arrival.of(5000 * kSecond + 500 * kSecond / 1000), 100 * kSecond - 10 * kSecond / 1000);
    EXPECT_TRUE(arrival.look(102 * kSecond, 9001 * kSecond));
    EXPECT_FALSE(arrival.look(103 * kSecond, 1000 * kSecond));  // set back
    EXPECT_EQ(arrival.of(9001 * kSecond + 500 * kSecond / 1000), 103 * kSecond);
    EXPECT_EQ(arrival.of(0), 100 * kSecond - 10 * kSecond / 1000);
    EXPECT_EQ(arrival.of(~0ull), 103 * kSecond);
}

// An adapter: a clock with its own rate from 1970, messages each ms that are delayed by up to 2 ms, at times 10 ms.
class Adapter {
public:
    explicit Adapter(double drift) : drift_(drift) {}
    // Returns {true time, timestamp, arrival}.
    std::array<std::uint64_t, 3> next() {
        sent_ns_ += kSecond / 1000;
        const std::uint64_t delay_ns =
            50'000 + random_() % (random_() % 100 == 0 ? 10 * kSecond / 1000 : 2 * kSecond / 1000);
        const auto timestamp = std::uint64_t(double(sent_ns_) * (1 + drift_)) / 1000 * 1000;  // whole us
        return {sent_ns_, timestamp, kStart + sent_ns_ + delay_ns};
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
            const auto [sent, timestamp, arrival] = adapter.next();
            const std::uint64_t t_ns = fit.monotonic_ns(timestamp, arrival);
            ASSERT_LE(t_ns, arrival);
            if (n < 1000) continue;
            const auto error_ns = std::int64_t(t_ns - Adapter::kStart - sent);
            earliest_ns = std::min(earliest_ns, error_ns);
            latest_ns = std::max(latest_ns, error_ns);
        }
        EXPECT_GE(earliest_ns, -2'000) << drift;  // the timestamp's own us
        // 50 us is the minimum of the path; the messages themselves were up to 10 ms late
        EXPECT_LE(latest_ns, 250'000) << drift;
    }
}

TEST(ClockFit, FollowsAClockThatIsSetAnew) {
    Adapter adapter(0);
    ClockFit fit;
    const auto run = [&](std::uint64_t step, int messages, std::int64_t max_late_ns) {
        for (int n = 0; n < messages; ++n) {
            const auto [sent, timestamp, arrival] = adapter.next();
            const std::uint64_t t_ns = fit.monotonic_ns(timestamp + step, arrival);
            ASSERT_LE(t_ns, arrival);
            ASSERT_LE(std::int64_t(t_ns - Adapter::kStart - sent), max_late_ns) << step << ' ' << n;
            ASSERT_GE(std::int64_t(t_ns - Adapter::kStart - sent), -2'000) << step << ' ' << n;
        }
    };
    const std::int64_t as_it_came = 11 * kSecond / 1000, fitted = 250'000;
    run(0, 100, as_it_came);
    run(0, 1000, fitted);
    run(3600 * kSecond, 100, as_it_came);  // forward: at once, with the first message without a delay
    run(3600 * kSecond, 1000, fitted);
    run(0, 100, as_it_came);  // back, by an hour
    run(0, 1000, fitted);
    run(0 - 200 * kSecond / 1000, 100, as_it_came);  // and by little
    run(0 - 200 * kSecond / 1000, 1000, fitted);
}

TEST(ClockFit, MessagesThatStayLateAreNotTakenForMessagesOnTimeAlsoWhereTheClockIsSet) {
    for (const std::uint64_t step : {std::uint64_t(0), 3600 * kSecond, 0 - 5 * kSecond}) {
        Adapter adapter(0);
        ClockFit fit;
        for (int n = 0; n < 1000; ++n) {
            const auto [sent, timestamp, arrival] = adapter.next();
            (void)fit.monotonic_ns(timestamp, arrival);
        }
        for (int n = 0; n < 600'000; ++n) {
            const auto [sent, timestamp, arrival] = adapter.next();
            const std::uint64_t t_ns = fit.monotonic_ns(timestamp + (n > 1000 ? step : 0), arrival + 2 * kSecond);
            ASSERT_LE(std::int64_t(t_ns - Adapter::kStart - sent), std::int64_t(30 * kSecond / 1000)) << step << ' ' << n;
        }
    }
}

TEST(ClockFit, AMessageThatWasHeldUpForLongChangesNothing) {
    Adapter adapter(0);
    ClockFit fit;
    for (int n = 0; n < 5000; ++n) {
        auto [sent, timestamp, arrival] = adapter.next();
        const bool held_up = n % 1000 > 900;
        // 300 to 400 ms late, all at once.
        if (held_up) arrival = Adapter::kStart + std::uint64_t(n / 1000 * 1000 + 901 + 400) * kSecond / 1000;
        const std::uint64_t t_ns = fit.monotonic_ns(timestamp, arrival);
        const auto late_ns = std::int64_t(t_ns - Adapter::kStart - sent);
        ASSERT_TRUE(n <= 500 || held_up || late_ns <= 300'000) << n;
        ASSERT_LE(t_ns, arrival);
    }
}

TEST(ClockFit, AFewLateMessagesOfASlowDeviceChangeNothing) {
    ClockFit fit;
    for (std::uint64_t n = 0; n < 100; ++n) {
        const std::uint64_t timestamp = n * kSecond,
                            arrival = Adapter::kStart + timestamp + (n % 20 > 15 ? 300 * kSecond / 1000 : 0);
        EXPECT_NEAR(double(fit.monotonic_ns(timestamp, arrival)), double(Adapter::kStart + timestamp), 1e6)
            << n;  // 200 ppm of 5 s
    }
}

TEST(ClockFit, SurvivesAnyTimestamps) {
    std::mt19937_64 random(3);
    ClockFit fit;
    for (int n = 0; n < 100'000; ++n) (void)fit.monotonic_ns(random(), random());
}

}  // namespace
}  // namespace tactiled
