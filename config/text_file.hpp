// Reads files of users completely and with a limit of size; writes files so that they are never incomplete.
#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/options.hpp"

namespace tactiled {

// Returns the bytes of a regular file of at most `max_bytes`. Otherwise adds an error with the remedy to `problems`.
// Never blocks on a pipe or a device. setup: never throws for bad input
std::optional<std::string> read_text_file(const std::string& path, std::size_t max_bytes, Problems& problems);

// Returns true if read_text_file() would find something at `path`. setup
bool is_text_file_there(const std::string& path);

// Files as they were when a configuration was loaded, so that it can be loaded again elsewhere. While an object
// exists, read_text_file() of this thread records the files that it reads (if `from` is empty), or takes every file
// from `from` and none from the disk. setup
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

// Returns `text` as a TOML string, in quotes.
std::string toml_text(const std::string& text);

struct SaveError : SetupError {
    using SetupError::SetupError;
};

// Replaces `path` atomically: temporary file beside it, fsync, rename, fsync of the folder.
// setup: throws SaveError if a step fails; before the rename the old file is unchanged. No temporary file remains
void replace_file(const std::string& path, std::string_view bytes);

}  // namespace tactiled
