// The clock of all frames.
#pragma once
#include <time.h>

#include <cstdint>

namespace tactiled {

// Returns the time on CLOCK_MONOTONIC. rt: wait-free
inline std::uint64_t now_ns() noexcept {
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
}

// Returns the time on CLOCK_BOOTTIME, which continues while the machine is suspended. The result is used for limits of age
// and never as a timestamp. rt: wait-free
inline std::uint64_t with_suspend_ns() noexcept {
    timespec t{};
    ::clock_gettime(CLOCK_BOOTTIME, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
}

// Converts the instant `monotonic_ns`, which is not later than now, to a clock that is never adjusted (CLOCK_MONOTONIC_RAW)
// and that continues while the machine is suspended. The result is compared with the clocks of devices. The result is never
// early: an interruption between the readings makes it later. rt: wait-free
inline std::uint64_t host_ns(std::uint64_t monotonic_ns) noexcept {
    const std::uint64_t before_ns = now_ns(), suspended_ns = with_suspend_ns() - before_ns;
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC_RAW, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec) + suspended_ns - (before_ns - monotonic_ns);
}

}  // namespace tactiled
