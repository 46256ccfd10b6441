// Version, commit and libraries of this build, for --version and for reports of faults.
#pragma once
#include <string>

namespace tactiled {

// commit of the sources, with "-dirty" if files differ from it; written by node/commit.cmake
extern const char* const kCommit;

// Returns "0.1.0", the commit and the versions of compiler and libraries, one fact per line.
std::string version_text();

}  // namespace tactiled
