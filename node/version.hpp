// Version, commit and libraries of this build, for --version and for reports of faults.
#pragma once
#include <string>

namespace tactiled {

extern const char* const kCommit;  // of the sources, with "-dirty" where files differ from it; written by node/commit.cmake

// "0.1.0", the commit and the versions of compiler and libraries, one fact a line.
std::string version_text();

}  // namespace tactiled
