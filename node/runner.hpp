// The right to run the pipeline. Each real-time thread that has work announces it; one of them at a time, the runner, does
// the work of all. The others return to their devices at once, and no thread waits for a lock.
#pragma once
#include <atomic>
#include <cstdint>

namespace tactiled {

// `Atomic` is std::atomic, or the model's in tests/orders.
template <template <class> class Atomic = std::atomic>
class Runner {
public:
    // Announces work that is visible to this thread. True: the caller is the runner now. It repeats
    //     seen = announced(); <all the work>; if (leave(seen)) return;
    // or gives up by resign(). False: the present runner will see the work. rt: wait-free
    [[nodiscard]] bool enter() noexcept {
        return announced_.fetch_add(1, std::memory_order_acq_rel) == 0;  // releases the work; acquires the last runner's
    }
    // The announcements so far, whose work a round that begins now will find. Runner only. rt: wait-free
    [[nodiscard]] std::uint32_t announced() const noexcept {
        return announced_.load(std::memory_order_acquire);  // pairs with enter() of each thread that announced
    }
    // Ends a round that began with `seen` announcements. False: there are new ones, and the caller is still the runner.
    // rt: wait-free
    [[nodiscard]] bool leave(std::uint32_t seen) noexcept {
        return announced_.compare_exchange_strong(seen, 0, std::memory_order_release, std::memory_order_relaxed);
    }
    // Gives the role up while there may be new announcements: the caller must make another thread enter(). rt: wait-free
    void resign() noexcept {
        announced_.exchange(0, std::memory_order_acq_rel);  // acquires: what was announced is passed on to the next runner
    }

private:
    Atomic<std::uint32_t> announced_{1};  // set-up is the first runner: nothing is delivered before it leaves
};

}  // namespace tactiled
