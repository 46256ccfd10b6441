// Files that a verb writes at its end.
#pragma once
#include <string>

namespace tactiled::ctl {

// Called before minutes of measuring. setup: throws SetupError where `path` cannot be written then
void check_output(const std::string& path);

}  // namespace tactiled::ctl
