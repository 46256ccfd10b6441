// Wakes the readers that sleep until the next node record. The cost for the real-time thread does not depend on the number
// of readers.
#pragma once
#include <atomic>

#include "node/shm/writer.hpp"
#include "node/wake_word.hpp"

namespace tactiled {

class Waker {
public:
    explicit Waker(SegmentWriter& segment) : segment_(segment) {}

    // Announces a published node record. Wakes up to kDirect readers; if more readers may sleep, the thread of run() wakes
    // them. Called by the runner of the pipeline. rt: at most two system calls, which wake at most kDirect readers
    void published() noexcept {
        if (!many_.load(std::memory_order_relaxed)) {
            if (segment_.wake_readers(kDirect) < kDirect) return;
            many_.store(true, std::memory_order_relaxed);
        }
        word_.wake();
    }

    // Wakes the remaining readers until stop() is called, in the calling thread.
    void run() noexcept;
    void stop() noexcept {
        stop_.store(true, std::memory_order_relaxed);
        word_.wake();
    }

private:
    static constexpr int kDirect = 2;      // one reader, and the thread for epoll (events.hpp)
    static constexpr int kAtOnce = 8;      // readers per system call, during which the kernel may not be preempted
    static constexpr int kPerPass = 4096;  // limit of readers per pass, because readers that sleep again are woken again

    SegmentWriter& segment_;
    std::atomic<bool> many_{false};  // more than kDirect readers slept when they were last counted
    std::atomic<bool> stop_{false};
    WakeWord word_;
};

}  // namespace tactiled
