#include "node/shm/waker.hpp"

#include "tactiled/reader.hpp"

namespace tactiled {

void Waker::run() noexcept {
    for (;;) {
        const std::uint32_t seen = word_.value();
        if (stop_.load(std::memory_order_relaxed)) return;
        int woken = 0;
        for (int now = kAtOnce; now == kAtOnce && woken < kPerPass; woken += now) now = segment_.wake_readers(kAtOnce);
        if (woken <= kDirect) many_.store(false, std::memory_order_relaxed);
        (void)word_.sleep(seen, kNever_ns);
    }
}

}  // namespace tactiled
