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

}  // namespace tactiled
