// A word on which one thread sleeps until another thread wakes it, or until a time.
#pragma once
#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <ctime>

namespace tactiled {

// A time that is never reached.
inline constexpr std::uint64_t kNever_ns = std::uint64_t(INT64_MAX);

class WakeWord {
public:
    // Returns the value to pass to sleep(). Call it before looking for work, so that a wake() in between is not lost.
    // rt: wait-free
    [[nodiscard]] std::uint32_t value() const noexcept { return word_.load(std::memory_order_acquire); }

    // Wakes the sleeper, or makes its next sleep() return immediately. rt: one system call
    void wake() noexcept {
        word_.fetch_add(1, std::memory_order_release);  // pairs with value(): the work is visible
        ::syscall(SYS_futex, &word_, FUTEX_WAKE, 1, nullptr, nullptr, 0);
    }

    // Sleeps until `until_ns` of CLOCK_MONOTONIC, or until wake() is called after value() returned `seen`. Returns
    // true if the time was reached. rt: blocks, one system call
    [[nodiscard]] bool sleep(std::uint32_t seen, std::uint64_t until_ns) noexcept {
        const timespec until{time_t(until_ns / 1'000'000'000u), long(until_ns % 1'000'000'000u)};
        while (word_.load(std::memory_order_relaxed) == seen) {  // the caller looks for work after value()
            const long result = ::syscall(kFutex, &word_, FUTEX_WAIT_BITSET, seen, &until, nullptr, FUTEX_BITSET_MATCH_ANY);
            if (result != 0 && errno == ETIMEDOUT) return true;
        }
        return false;
    }

private:
#if defined(SYS_futex_time64)  // 32-bit processors: the call whose time has as many bits as time_t
    static constexpr long kFutex = sizeof(time_t) == 8 ? SYS_futex_time64 : SYS_futex;
#else
    static constexpr long kFutex = SYS_futex;
#endif
    static_assert(sizeof(std::atomic<std::uint32_t>) == 4);
    std::atomic<std::uint32_t> word_{0};
};

}  // namespace tactiled
