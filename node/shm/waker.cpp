#include "node/shm/waker.hpp"

#include "tactiled/reader.hpp"

namespace tactiled {
namespace {
constexpr std::uint64_t kLookForStopNs = 100'000'000;
}

void Waker::run(const std::atomic<bool>& stop) noexcept {
    while (!stop.load(std::memory_order_relaxed)) {
        const std::uint32_t seen = word_.value();
        int woken = 0;
        for (int now = kAtOnce; now == kAtOnce && woken < kPerPass; woken += now) now = segment_.wake_readers(kAtOnce);
        if (woken <= kDirect) many_.store(false, std::memory_order_relaxed);
        (void)word_.sleep(seen, monotonic_ns() + kLookForStopNs);
    }
}

}  // namespace tactiled
