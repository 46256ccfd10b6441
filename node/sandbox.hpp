// System calls that a running daemon never makes, forbidden by the kernel for all its threads and for good: who takes it
// over, through a hole in a parser, starts no program. Files stay what the user's rights allow. Under systemd the unit
// forbids more (systemd/); this holds without it.
#pragma once
#include <string>

namespace tactiled {

// The calls that start programs, trace processes, make written memory executable, load kernel modules, mount, change name
// spaces, identity, clock or keys, and io_uring: EPERM from now on.
// Call when all is set up. Returns "" or what was refused; the daemon runs all the same. setup
std::string enter_sandbox();

// False where enter_sandbox() has no filter for the processor that this program was compiled for. rt: wait-free
[[nodiscard]] bool has_system_call_filter() noexcept;

}  // namespace tactiled
