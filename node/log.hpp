// One line of log to standard error, with the journal's level prefix when nobody watches a terminal.
#pragma once
#include <string_view>

namespace tactiled {

enum class LogLevel { error = 3, warning = 4, info = 6 };  // the numbers of syslog(3)

// Any thread but the real-time ones. Never blocks: a line that standard error cannot take now is dropped and counted;
// the next line that gets through says how many.
void log_line(LogLevel level, std::string_view text) noexcept;

// Call first of all. Who starts us may have closed descriptors 0 to 2: the next file that is opened, the segment, would be
// the log, and written over. setup
void hold_standard_descriptors() noexcept;

}  // namespace tactiled
