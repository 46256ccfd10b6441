// The clock of the simulated world: the program's own clock_gettime(), for every clock. Product code uses it
// unchanged.
#pragma once
#include <cstdint>
#include <functional>

namespace tactiled::faults {

// Called by a sleep in the world: the world continues until that time. Empty: no code may sleep.
extern std::function<void(std::uint64_t until_ns)> while_asleep;

extern std::uint64_t world_ns;  // since the boot of the world; the wall clock is that much after 2026-01-01

}  // namespace tactiled::faults
