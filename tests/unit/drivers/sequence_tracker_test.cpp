#include "drivers/wire/sequence_tracker.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tactiled {
namespace {

constexpr unsigned kBits = 16;

struct Device {
    std::uint32_t count;
    std::uint32_t content = 0;  // the high half is the device's own
    void go_on() { ++count, ++content; }
};

// What became of frames that were GOOD for the reader.
struct Believed {
    int mine = 0, others = 0, contested = 0;
};

Believed mix(SequenceTracker& tracker, Device& mine, Device& others, double share_of_others, int frames, unsigned seed) {
    std::mt19937 random(seed);
    std::bernoulli_distribution is_others(share_of_others);
    Believed believed;
    for (int i = 0; i < frames; ++i) {
        Device& sender = is_others(random) ? others : mine;
        const auto verdict = tracker.next(sender.count & 0xFFFF, kBits, sender.content, false);
        if (verdict.contested)
            ++believed.contested;
        else if (verdict.accept)
            ++(&sender == &mine ? believed.mine : believed.others);
        sender.go_on();
    }
    return believed;
}

int orderly_until_believed(SequenceTracker& tracker, Device& device) {
    for (int n = 0; n < 1000; ++n, device.go_on())
        if (!tracker.next(device.count & 0xFFFF, kBits, device.content, false).contested) return n;
    return 1000;
}

TEST(SequenceTracker, TwoDevicesUnderOneNameAreToldWhereverTheirCountersStand) {
    for (const std::uint32_t ahead : {0u, 1u, 3u, 100u, 32767u, 32768u, 32769u, 65533u})
        for (const double share : {0.5, 0.1, 0.03})
            for (unsigned seed = 0; seed < 20; ++seed) {
                SequenceTracker tracker;
                Device mine{7}, others{7 + ahead, 1u << 16};
                (void)mix(tracker, mine, others, 0, 10, seed);
                const Believed until_told = mix(tracker, mine, others, share, 1500, seed);
                EXPECT_LE(until_told.others, 24) << ahead << ' ' << share << ' ' << seed;
                // A rare one that is behind is dropped, each time.
                if (share > 0.05) { EXPECT_GT(until_told.contested, 0) << ahead << ' ' << share << ' ' << seed; }
            }
}

TEST(SequenceTracker, OneDeviceIsBelievedAgainAfterAStretchInOrder) {
    SequenceTracker tracker;
    Device mine{7}, others{500, 1u << 16};
    (void)mix(tracker, mine, others, 0.5, 500, 1);
    const int n = orderly_until_believed(tracker, mine);
    EXPECT_GT(n, int(SequenceTracker::kMostDoubt) - 4);
    EXPECT_LE(n, int(SequenceTracker::kMostDoubt) + 2);
    mine.go_on();
    EXPECT_EQ(mix(tracker, mine, others, 0, 1000, 1).mine, 1000);
}

TEST(SequenceTracker, ADeviceThatSendsEachFrameTwiceIsOne) {
    SequenceTracker tracker;
    Device mine{7};
    for (int i = 0; i < 1000; ++i, mine.go_on()) {
        const auto first = tracker.next(mine.count, kBits, mine.content, false);
        const auto again = tracker.next(mine.count, kBits, mine.content, false);
        ASSERT_TRUE(first.accept && !first.contested);
        ASSERT_TRUE(!again.accept && !again.contested);
    }
}

TEST(SequenceTracker, ARestartNowAndThenIsNoSecondDevice) {
    for (const bool has_clock : {false, true}) {
        SequenceTracker tracker;
        Device mine{0};
        for (int i = 0; i < 2000; ++i, mine.go_on()) {
            const bool restarted = i % 100 == 99;
            if (restarted) mine.count = 0;
            ASSERT_FALSE(tracker.next(mine.count, kBits, mine.content, restarted && has_clock).contested) << i;
        }
    }
}

TEST(SequenceTracker, FramesThatAreOvertakenAreNoSecondDevice) {
    for (const std::uint32_t late_by : {1u, 2u, 7u}) {  // of each ten frames the first comes so much later
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

}  // namespace
}  // namespace tactiled
