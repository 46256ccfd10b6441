// One line of log to standard error, with the journal's level prefix when nobody watches a terminal.
#pragma once
#include <fmt/format.h>

#include <string_view>

namespace tactiled {

enum class LogLevel { error = 3, warning = 4, info = 6 };  // the numbers of syslog(3)

// Any thread but the real-time ones. Never blocks: a line that standard error cannot take now is dropped and counted;
// the next line that gets through says how many. Needs no memory; what is longer than 960 bytes is cut.
void log_text(LogLevel level, std::string_view text) noexcept;
void log_formatted(LogLevel level, fmt::string_view format, fmt::format_args values) noexcept;
template <class... Values>
void log_line(LogLevel level, fmt::format_string<Values...> format, const Values&... values) noexcept {
    log_formatted(level, format, fmt::make_format_args(values...));
}

// Call first of all. Who starts us may have closed descriptors 0 to 2: the next file that is opened, the segment, would be
// the log, and written over. setup
void hold_standard_descriptors() noexcept;

}  // namespace tactiled
