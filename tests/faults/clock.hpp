// The clock of the simulated world: the program's own clock_gettime(), for every clock. Product code runs on it unchanged.
#pragma once
#include <cstdint>
#include <functional>

namespace tactiled::faults {

// Whoever sleeps in the world: the world goes on until that time. Empty: nobody may.
extern std::function<void(std::uint64_t until_ns)> while_asleep;

extern std::uint64_t world_ns;  // since the boot of the world; the wall clock is that much after 2026-01-01

}  // namespace tactiled::faults
