// The right to run the pipeline. Each real-time thread announces its work. One thread at a time, the runner, does the work
// of all threads; the other threads return to their devices immediately. No thread waits for a lock.
#pragma once
#include <atomic>
#include <cstdint>

namespace tactiled {

class Runner {
public:
    // Announces work that is visible to this thread. Returns true if the caller is the runner now and must call
    // run(). Returns false if the present runner will see the work. rt: wait-free
    [[nodiscard]] bool enter() noexcept {
        return announced_.fetch_add(1, std::memory_order_release) == 0;  // pairs with announced()
    }
    // Repeats `round`, which does all available work, until no thread has announced more work. Returns false if there may be
    // more work after `max_rounds`; the caller is then no longer the runner and must make another thread enter(). Runner
    // only.
    // rt: bounded by max_rounds
    template <class Round>
    [[nodiscard]] bool run(int max_rounds, Round&& round) noexcept {
        for (int n = 0; n < max_rounds; ++n) {
            const std::uint32_t seen = announced();
            round();
            if (leave(seen)) return true;
        }
        resign();
        return false;
    }

private:
    // Returns the number of announcements so far. A round that begins now finds their work. The load acquires the
    // announcements and the last runner's work, because only read-modify-writes change the word and each continues the
    // earlier release sequences.
    [[nodiscard]] std::uint32_t announced() const noexcept { return announced_.load(std::memory_order_acquire); }
    // Ends a round that began with `seen` announcements. Returns false if there are new ones; the caller is then
    // still the runner.
    [[nodiscard]] bool leave(std::uint32_t seen) noexcept {
        return announced_.compare_exchange_strong(seen, 0, std::memory_order_release, std::memory_order_relaxed);
    }
    // Gives up the role while there may be new announcements.
    void resign() noexcept { announced_.exchange(0, std::memory_order_release); }

    std::atomic<std::uint32_t> announced_{1};  // the set-up is the first runner, so that nothing is delivered before it ends
};

}  // namespace tactiled
