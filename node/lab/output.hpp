// Files that a verb writes at its end.
#pragma once
#include <string>

namespace tactiled::ctl {

// Checks that `path` can be written, before minutes of measuring. setup: throws SetupError where it cannot
void check_output(const std::string& path);

}  // namespace tactiled::ctl
