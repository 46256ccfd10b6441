// The clock of the simulated world: the program's own clock_gettime(), for every clock. Product code runs on it unchanged.
#pragma once
#include <cstdint>

namespace tactiled::faults {

extern std::uint64_t world_ns;  // since the boot of the world; the wall clock is that much after 2026-01-01

}  // namespace tactiled::faults
