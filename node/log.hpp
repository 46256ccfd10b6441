// Writes lines of log to standard error, with the journal's level prefix if standard error is not a terminal.
#pragma once
#include <fmt/format.h>

#include <string_view>

namespace tactiled {

enum class LogLevel { error = 3, warning = 4, info = 6 };  // the numbers of syslog(3)

// Writes one line, from any thread except the real-time threads. Never blocks: a line that standard error cannot accept is
// dropped and counted, and the next successful line reports the count. Allocates no memory; a text of more than 960 bytes is
// cut.
void log_text(LogLevel level, std::string_view text) noexcept;
void log_formatted(LogLevel level, fmt::string_view format, fmt::format_args values) noexcept;
template <class... Values>
void log_line(LogLevel level, fmt::format_string<Values...> format, const Values&... values) noexcept {
    log_formatted(level, format, fmt::make_format_args(values...));
}

// Must be called first. If the parent has closed descriptors 0 to 2, the next file that is opened, the segment, would
// get the log's descriptor and be overwritten. setup
void hold_standard_descriptors() noexcept;

}  // namespace tactiled
