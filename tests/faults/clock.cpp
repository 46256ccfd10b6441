#include "clock.hpp"

#include <ctime>

namespace tactiled::faults {

std::uint64_t world_ns = 1'000'000'000'000;
std::function<void(std::uint64_t until_ns)> while_asleep;

}  // namespace tactiled::faults

extern "C" int clock_gettime(clockid_t clock, timespec* out) noexcept {
    constexpr std::uint64_t k2026_s = 1'767'225'600;
    const std::uint64_t ns = tactiled::faults::world_ns;
    out->tv_sec = time_t(ns / 1'000'000'000 + (clock == CLOCK_REALTIME ? k2026_s : 0));
    out->tv_nsec = long(ns % 1'000'000'000);
    return 0;
}

extern "C" int clock_nanosleep(clockid_t, int, const timespec* until, timespec*) {
    if (tactiled::faults::while_asleep)
        tactiled::faults::while_asleep(std::uint64_t(until->tv_sec) * 1'000'000'000u + std::uint64_t(until->tv_nsec));
    return 0;
}
