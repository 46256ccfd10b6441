// One thread at a time does the work of all, and no work is left.
#include "node/runner.hpp"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "node/wake_word.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

TEST(Runner, SetUpIsTheFirstRunner) {
    Runner runner;
    EXPECT_FALSE(runner.enter());
    int rounds = 0;
    EXPECT_TRUE(runner.run(4, [&] { ++rounds; }));
    EXPECT_EQ(rounds, 1);
    EXPECT_TRUE(runner.enter());
}

TEST(Runner, WorkThatIsAnnouncedDuringARoundNeedsAnother) {
    Runner runner;
    int rounds = 0;
    EXPECT_TRUE(runner.run(4, [&] {
        if (++rounds == 1) {
            EXPECT_FALSE(runner.enter());  // another thread
        }
    }));
    EXPECT_EQ(rounds, 2);
    EXPECT_TRUE(runner.enter());
}

TEST(Runner, AfterTheLastRoundTheNextToEnterIsTheRunner) {
    Runner runner;
    int rounds = 0;
    EXPECT_FALSE(runner.run(2, [&] {
        ++rounds;
        EXPECT_FALSE(runner.enter());
    }));
    EXPECT_EQ(rounds, 2);
    EXPECT_TRUE(runner.enter());
}

// Plain counters represent the sensors: thread sanitizer detects whether each runner begins after the last one.
TEST(Runner, NoWorkIsLostAndOnlyOneThreadWorks) {
    constexpr int kThreads = 4;
    constexpr std::uint64_t kRounds = 20'000;
    Runner runner;
    std::atomic<std::uint64_t> made[kThreads] = {};
    std::uint64_t done[kThreads] = {}, cycles = 0;  // used by the runner
    std::atomic<int> inside{0};
    std::atomic<bool> overlapped{false}, end{false};
    WakeWord word;
    const auto run = [&](int max_cycles) {
        const bool all = runner.run(max_cycles, [&] {
            if (inside.fetch_add(1) != 0) overlapped = true;
            for (int i = 0; i < kThreads; ++i) done[i] = made[i].load(std::memory_order_acquire);
            ++cycles;
            inside.fetch_sub(1);
        });
        if (!all) word.wake();
    };
    run(1);
    std::thread backstop([&] {
        while (!end) {
            const std::uint32_t seen = word.value();
            if (runner.enter()) run(2);
            (void)word.sleep(seen, monotonic_ns() + 100'000'000);
        }
    });
    std::vector<std::thread> threads;
    for (int i = 0; i < kThreads; ++i)
        threads.emplace_back([&, i] {
            for (std::uint64_t n = 1; n <= kRounds; ++n) {
                made[i].store(n, std::memory_order_release);
                if (runner.enter()) run(2);
            }
        });
    for (auto& thread : threads) thread.join();
    end = true;
    word.wake();
    backstop.join();
    for (const std::uint64_t n : done) EXPECT_EQ(n, kRounds);
    EXPECT_FALSE(overlapped);
    EXPECT_LE(cycles, 2 * kThreads * kRounds);
}

TEST(WakeWord, AWakeBeforeTheSleepIsNotLost) {
    WakeWord word;
    const std::uint32_t seen = word.value();
    word.wake();
    EXPECT_FALSE(word.sleep(seen, monotonic_ns() + 10'000'000'000u));
    EXPECT_TRUE(word.sleep(word.value(), monotonic_ns() + 1'000'000u));
    EXPECT_TRUE(word.sleep(word.value(), 0));  // a time that has passed
}

}  // namespace
}  // namespace tactiled
