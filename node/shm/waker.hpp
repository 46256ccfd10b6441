// Wakes the readers that sleep until the next node record, with a cost for the real-time thread that does not depend
// on their number.
#pragma once
#include <atomic>

#include "node/shm/writer.hpp"
#include "node/wake_word.hpp"

namespace tactiled {

class Waker {
public:
    explicit Waker(SegmentWriter& segment) : segment_(segment) {}

    // Announces a published node record. Wakes up to kDirect readers; if more may sleep, they are left to the thread
    // of run(). Called by the runner of the pipeline. rt: at most two system calls, which wake at most kDirect
    // readers
    void published() noexcept {
        if (!many_.load(std::memory_order_relaxed)) {
            if (segment_.wake_readers(kDirect) < kDirect) return;
            many_.store(true, std::memory_order_relaxed);
        }
        word_.wake();
    }

    // Wakes the others, in the thread that calls it, until stop() is called.
    void run() noexcept;
    void stop() noexcept {
        stop_.store(true, std::memory_order_relaxed);
        word_.wake();
    }

private:
    static constexpr int kDirect = 2;      // the usual reader, and the thread that serves epoll (events.hpp)
    static constexpr int kAtOnce = 8;      // readers per system call, in which the kernel may not be preempted
    static constexpr int kPerPass = 4096;  // limit of readers per pass: those that sleep again are woken again

    SegmentWriter& segment_;
    std::atomic<bool> many_{false};  // more than kDirect readers slept when they were last counted
    std::atomic<bool> stop_{false};
    WakeWord word_;
};

}  // namespace tactiled
