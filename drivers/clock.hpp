// The clock of all frames.
#pragma once
#include <time.h>

#include <cstdint>

namespace tactiled {

// CLOCK_MONOTONIC. rt: wait-free
inline std::uint64_t now_ns() noexcept {
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
}

// CLOCK_BOOTTIME, which goes on while the machine is suspended: for how old something may be, never for stamps. rt:
// wait-free
inline std::uint64_t with_suspend_ns() noexcept {
    timespec t{};
    ::clock_gettime(CLOCK_BOOTTIME, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
}

// The instant `monotonic_ns`, which is not later than now, on a clock that nobody corrects (CLOCK_MONOTONIC_RAW) and that
// goes on while the machine is suspended. For comparisons with the clocks of devices. Never early: a thread that is held up
// between its readings makes the result later. rt: wait-free
inline std::uint64_t host_ns(std::uint64_t monotonic_ns) noexcept {
    const std::uint64_t before_ns = now_ns(), suspended_ns = with_suspend_ns() - before_ns;
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC_RAW, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec) + suspended_ns - (before_ns - monotonic_ns);
}

}  // namespace tactiled
