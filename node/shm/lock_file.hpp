// A lock that ends with its process, on an empty file of its own.
#pragma once
#include <string>

namespace tactiled {

// An open-file-description lock for writing on the whole file; the kernel drops it with the last descriptor.
bool lock(int fd);
// True if the path still names the open file.
bool is_still_named(int fd, const std::string& path);

// Holds `path` until its end and then removes it. A file that a killed process left is taken over.
class LockFile {
public:
    enum class State {
        held,
        busy,    // another process holds it
        foreign  // another user's file, or no file: it says nothing, and nothing is held
    };
    explicit LockFile(std::string path) : path_(std::move(path)) {}
    ~LockFile();
    LockFile(const LockFile&) = delete;
    LockFile& operator=(const LockFile&) = delete;

    // Waits for up to `patience_ms` for a lock that another process holds.
    State take(int patience_ms);
    [[nodiscard]] const std::string& path() const { return path_; }

private:
    std::string path_;
    int fd_ = -1;
};

}  // namespace tactiled
