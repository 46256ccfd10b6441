// The state of the guard, and its interface for planted errors.
#pragma once

namespace rtguard {

enum Kind { kMalloc, kFree, kLock, kSyscall, kMinorFault, kMajorFault, kKinds };
inline constexpr const char* kKindName[kKinds] = {"malloc", "free", "lock", "syscall", "minor_fault", "major_fault"};

}  // namespace rtguard

extern "C" {
bool rtguard_is_planting_time();  // once in 500 armed sections, after the warm-up
const char* rtguard_thread_name();
}
