// Forbids permanently, for all threads, the system calls that a running daemon does not need. Code injected through a fault
// in a parser can then not start a program. Access to files is limited by the user's rights. Under systemd the unit forbids
// more (systemd/); this filter works without it.
#pragma once
#include <string>

namespace tactiled {

// Forbids the calls that start programs, trace processes, make written memory executable, load kernel modules, mount, change
// name spaces, identity, clock or keys, and io_uring. These calls return EPERM from now on. Call this function after the
// set-up. Returns "" or the reason of a failure; the daemon runs in any case. setup
std::string enter_sandbox();

// Returns false if enter_sandbox() has no filter for the processor that this program was compiled for. rt: wait-free
[[nodiscard]] bool has_system_call_filter() noexcept;

}  // namespace tactiled
