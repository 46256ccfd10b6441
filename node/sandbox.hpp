// What a running daemon never does, forbidden by the kernel for all its threads and for good: whoever takes it over, through
// a hole in a parser, gets no shell. Under systemd the unit forbids more (systemd/); this holds without it.
#pragma once
#include <string>

namespace tactiled {

// Other programs, other processes' memory, new code, kernel modules, mounts, name spaces, keys, io_uring: EPERM from now on.
// Call when all is set up. Returns "" or what was refused; the daemon runs all the same. setup
std::string enter_sandbox();

}  // namespace tactiled
