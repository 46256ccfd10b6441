// The warnings of a calibration on one page: at most ten lines, the worst first, one for each cause, each with a remedy.
#pragma once
#include <string>
#include <vector>

namespace tactiled::ctl {

inline constexpr std::size_t kWarningLines = 10;

// Returns the warnings of the same cause side by side, the worst cause first.
std::vector<std::string> by_consequence(std::vector<std::string> warnings);

// Returns the lines of the page. A warning that begins with a blank is a detail of the one before: it is shown if there is
// room.
std::vector<std::string> warning_page(const std::vector<std::string>& warnings);

}  // namespace tactiled::ctl
