// Lends an object to the thread that runs the pipeline, which uses the object between two cycles, and waits for its return.
#pragma once
#include <atomic>
#include <cstdint>

#include "node/wake_word.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {

template <class T>
class Handover {
public:
    // Wakes the taking thread. Returns false, with the object unchanged, if the object was not taken within `patience_ms`.
    // One offer at a time. setup: from another thread than take()
    [[nodiscard]] bool offer(T& object, WakeWord& taker, int patience_ms) noexcept {
        done_.store(false, std::memory_order_relaxed);
        offered_.store(&object, std::memory_order_release);  // pairs with take(): the object is filled
        taker.wake();
        for (int ms = 0; !done_.load(std::memory_order_acquire); ++ms) {
            // Withdraws the offer unless the object is in use, which takes microseconds.
            if (ms >= patience_ms && offered_.exchange(nullptr, std::memory_order_relaxed) != nullptr) return false;
            tactiled_sleep_until(monotonic_ns() + 1'000'000u);
        }
        return true;
    }

    // Returns the offered object, or nullptr. give_back() must follow. rt: wait-free
    [[nodiscard]] T* take() noexcept {
        if (offered_.load(std::memory_order_relaxed) == nullptr)
            return nullptr;                                            // a load costs less in each cycle than an exchange
        return offered_.exchange(nullptr, std::memory_order_acquire);  // nullptr: the offer was withdrawn
    }
    // rt: wait-free
    void give_back() noexcept { done_.store(true, std::memory_order_release); }  // pairs with offer(): the work is done

private:
    std::atomic<T*> offered_{nullptr};  // nullptr: no offer, or it was taken
    std::atomic<bool> done_{false};
};

}  // namespace tactiled
