// Files that a user wrote, whole and with a limit; and files that must not be lost half-written.
#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/options.hpp"

namespace tactiled {

// The bytes of a regular file of at most `max_bytes`. Else an error in `problems` that says what to do. Never blocks on a
// pipe or a device. setup: never throws for bad input
std::optional<std::string> read_text_file(const std::string& path, std::size_t max_bytes, Problems& problems);

// True if read_text_file() would find something at `path`. setup
bool is_text_file_there(const std::string& path);

// Files as they were when something was loaded, so that it can be loaded again elsewhere. While one lives, read_text_file()
// of this thread notes what it reads (`from` is empty), or takes every file from `from` and none from the disk. setup
class TextFiles {
public:
    using List = std::vector<std::pair<std::string, std::string>>;  // path, bytes; in the order of reading
    explicit TextFiles(List from = {});
    ~TextFiles();
    TextFiles(const TextFiles&) = delete;
    TextFiles& operator=(const TextFiles&) = delete;
    [[nodiscard]] const List& list() const { return list_; }

private:
    friend std::optional<std::string> read_text_file(const std::string&, std::size_t, Problems&);
    friend bool is_text_file_there(const std::string&);
    List list_;
    bool notes_;
    TextFiles* before_;
};

// `text` as a string of TOML, in quotes.
std::string toml_text(const std::string& text);

struct SaveError : SetupError {
    using SetupError::SetupError;
};

// Replaces `path` at once or not at all: temporary file beside it, fsync, rename, fsync of the folder.
// setup: throws SaveError where a step is refused; the old file stands as it was then, but after the rename, and no temporary one
void replace_file(const std::string& path, std::string_view bytes);

}  // namespace tactiled
