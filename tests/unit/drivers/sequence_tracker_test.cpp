#include "drivers/wire/sequence_tracker.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tactiled {
namespace {

constexpr unsigned kBits = 16;

// Two devices send with one number, in a random order in each period: the second one's counter is `ahead`, its clock
// `clock_ahead`, and only each `every`th of its frames arrives.
struct Two {
    std::int64_t ahead = 0;
    int every = 1;
    bool has_clock = false;
    std::int64_t clock_ahead = 0;

    SequenceTracker tracker{};
    std::int64_t now = 1000, time = 0;
    int seconds_believed = 0, contested = 0, dropped = 0;  // seconds_believed: of the second device; the others: of both

    void send(bool first) {
        const std::int64_t count = first ? now : now + ahead, sent = first ? 10 * now : 10 * now + clock_ahead + 1;
        const auto content = std::uint32_t(2 * count + (first ? 0 : 1));
        const auto verdict = tracker.next(std::uint32_t(count) & 0xFFFF, kBits, content, has_clock && sent < time);
        if (verdict.accept) time = sent;
        if (verdict.contested)
            ++contested;
        else if (!verdict.accept)
            ++dropped;
        else if (!first)
            ++seconds_believed;
    }
    void alone(int periods) {
        for (int i = 0; i < periods; ++i, ++now) send(true);
    }
    // Returns true if the two were detected.
    bool run(int periods, unsigned seed) {
        std::mt19937 random(seed);
        for (int i = 0; i < periods && contested == 0; ++i, ++now) {
            const bool is_heard = i % every == 0, before = random() % 2 == 0;
            if (is_heard && before) send(false);
            send(true);
            if (is_heard && !before) send(false);
        }
        return contested != 0;
    }
};

TEST(SequenceTracker, TwoDevicesUnderOneNameAreReportedWhereverTheirCountersAndClocksStand) {
    for (const std::int64_t ahead :
         {-10'000, -20, -9, -5, -1, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 20, 100, 10'000, 32'767, 32'768})
        for (const int every : {1, 2, 5, 10, 20})
            for (const std::int64_t clock_ahead : {0, 0, 5000, -5000})
                for (unsigned seed = 0; seed < 10; ++seed) {
                    Two two{.ahead = ahead, .every = every, .has_clock = seed % 2 == 0, .clock_ahead = clock_ahead};
                    two.alone(20);
                    EXPECT_TRUE(two.run(1000, seed)) << ahead << ' ' << every << ' ' << clock_ahead << ' ' << seed;
                    EXPECT_LE(two.seconds_believed, 19) << ahead << ' ' << every << ' ' << clock_ahead << ' ' << seed;
                }
}

TEST(SequenceTracker, OneDeviceIsBelievedAgainAfterAStretchInOrder) {
    Two two{.ahead = 500};
    two.alone(20);
    ASSERT_TRUE(two.run(100, 1));
    two.contested = 0;
    for (int i = 0; i < 300; ++i, ++two.now) {  // no frame is assigned until it is alone
        two.send(true);
        two.send(false);
    }
    EXPECT_GE(two.contested, 590);
    two.contested = two.dropped = two.seconds_believed = 0;
    two.alone(1000);
    EXPECT_GT(two.contested, int(SequenceTracker::kMax) - 40);
    EXPECT_LE(two.contested, int(SequenceTracker::kMax) + 2);
    EXPECT_EQ(two.dropped, 0);
}

TEST(SequenceTracker, ADeviceThatSendsEachFrameTwiceIsOne) {
    SequenceTracker tracker;
    for (std::uint32_t i = 0; i < 1000; ++i) {
        const auto first = tracker.next(i, kBits, i, false), again = tracker.next(i, kBits, i, false);
        ASSERT_TRUE(first.accept && !first.contested);
        ASSERT_TRUE(!again.accept && !again.contested);
    }
}

TEST(SequenceTracker, ARestartNowAndThenIsNoSecondDevice) {
    for (const bool has_clock : {false, true}) {
        SequenceTracker tracker;
        for (std::uint32_t i = 0, count = 0; i < 2000; ++i, ++count) {
            if (i % 100 == 99) count = 0;
            ASSERT_FALSE(tracker.next(count, kBits, i, has_clock && count == 0).contested) << i;
        }
    }
}

TEST(SequenceTracker, AClockThatJittersBackUnderACounterInOrderIsNoRestart) {
    SequenceTracker tracker;
    for (std::uint32_t i = 0; i < 2000; ++i) ASSERT_FALSE(tracker.next(i, kBits, i, i % 5 == 4).contested) << i;
}

TEST(SequenceTracker, FramesThatAreOvertakenAreNoSecondDevice) {
    for (const std::uint32_t late_by : {1u, 2u, 7u}) {  // the first of each ten frames arrives so much later
        SequenceTracker tracker;
        std::uint32_t accepted = 0;
        for (std::uint32_t i = 0; i < 5000; ++i) {
            const std::uint32_t place = i % 10;
            const std::uint32_t count = place < late_by ? i + 1 : place == late_by ? i - late_by : i;
            const auto verdict = tracker.next(count, kBits, count, false);
            ASSERT_FALSE(verdict.contested) << i;
            accepted += verdict.accept ? 1 : 0;
        }
        EXPECT_EQ(accepted, 4500u) << late_by;
    }
}

TEST(SequenceTracker, ARestartOfADeviceThatLosesFramesIsNoSecondDevice) {
    for (unsigned seed = 0; seed < 300; ++seed) {
        std::mt19937 random(seed);
        std::bernoulli_distribution is_lost(0.2);
        SequenceTracker tracker;
        for (std::uint32_t i = 0, count = 1000; i < 300; ++i, ++count) {
            if (i == 60 + seed % 60) count = seed % 2 == 0 ? 0 : 0xFFF0;
            if (!is_lost(random)) { ASSERT_FALSE(tracker.next(count & 0xFFFF, kBits, i, false).contested) << seed; }
        }
    }
}

TEST(SequenceTracker, ADeviceThatLosesFramesIsOneHoweverNarrowItsCounter) {
    for (const unsigned bits : {2u, 4u, 8u, 16u})
        for (const double loss : {0.1, 0.3, 0.6}) {
            std::mt19937 random(1);
            std::bernoulli_distribution is_lost(loss);
            SequenceTracker tracker;
            for (std::uint32_t i = 0; i < 20'000; ++i)
                if (!is_lost(random)) {
                    ASSERT_FALSE(tracker.next(i & ((1u << bits) - 1), bits, i, false).contested) << bits;
                }
        }
}

}  // namespace
}  // namespace tactiled
