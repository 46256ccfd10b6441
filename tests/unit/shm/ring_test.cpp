#include "node/ring.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace tactiled {
namespace {

TEST(Ring, RefusesTheNewestWhenFull) {
    Ring<int> ring(4);
    for (int i = 0; i < 4; ++i) {
        int* const slot = ring.claim();
        ASSERT_NE(slot, nullptr);
        *slot = i;
        ring.push();
    }
    EXPECT_EQ(ring.claim(), nullptr);
    for (int i = 0; i < 4; ++i) {
        ASSERT_NE(ring.front(), nullptr);
        EXPECT_EQ(*ring.front(), i);  // the oldest ones are all there
        ring.pop();
    }
    EXPECT_EQ(ring.front(), nullptr);
    EXPECT_NE(ring.claim(), nullptr);  // room again
}

TEST(Ring, ShowsABurstOnlyWhenCommitted) {
    Ring<int> ring(8);
    *ring.claim() = 1;
    ring.push();
    EXPECT_EQ(ring.front(), nullptr);
    ring.commit();
    ASSERT_NE(ring.front(), nullptr);
    EXPECT_EQ(*ring.front(), 1);
}

TEST(Ring, AnAbandonedClaimIsNoItem) {
    Ring<int> ring(2);
    *ring.claim() = 1;  // a read that timed out
    *ring.claim() = 2;
    ring.push();
    ring.commit();
    EXPECT_EQ(*ring.front(), 2);
    ring.pop();
    EXPECT_EQ(ring.front(), nullptr);
}

// Every item arrives complete, once, in order, while the ring wraps and fills thousands of times.
TEST(Ring, LosesAndMixesNothingBetweenTwoThreads) {
    struct Item {
        std::uint64_t word[16];
    };
    constexpr std::uint64_t kItems = 300'000;
    Ring<Item> ring(16);
    std::thread producer([&] {
        for (std::uint64_t i = 0; i < kItems;) {
            Item* const slot = ring.claim();
            if (slot == nullptr) {
                std::this_thread::yield();
                continue;
            }
            for (auto& word : slot->word) word = i;
            ring.push();
            if (++i % 5 == 0) ring.commit();
        }
        ring.commit();
    });
    std::uint64_t wrong = 0;
    for (std::uint64_t i = 0; i < kItems;) {
        const Item* const item = ring.front();
        if (item == nullptr) {
            std::this_thread::yield();
            continue;
        }
        for (const auto word : item->word) wrong += word != i;
        ring.pop();
        ++i;
    }
    producer.join();
    EXPECT_EQ(wrong, 0u);
    EXPECT_EQ(ring.front(), nullptr);
}

}  // namespace
}  // namespace tactiled
