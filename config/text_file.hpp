// Files that a user wrote, whole and with a limit; and files that must not be lost half-written.
#pragma once
#include <optional>
#include <string>
#include <string_view>

#include "config/options.hpp"

namespace tactiled {

// The bytes of a regular file of at most `max_bytes`. Else an error in `problems` that says what to do. Never blocks on a
// pipe or a device. setup: never throws for bad input
std::optional<std::string> read_text_file(const std::string& path, std::size_t max_bytes, Problems& problems);

// `text` as a string of TOML, in quotes.
std::string toml_text(const std::string& text);

struct SaveError : SetupError {
    using SetupError::SetupError;
};

// Replaces `path` at once or not at all: temporary file beside it, fsync, rename, fsync of the folder.
// setup: throws SaveError where a step is refused; the old file stands as it was then, but after the rename, and no temporary one
void replace_file(const std::string& path, std::string_view bytes);

}  // namespace tactiled
