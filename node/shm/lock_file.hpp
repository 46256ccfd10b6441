// A lock that ends with its process, on an empty file of its own.
#pragma once
#include <string>

namespace tactiled {

// Takes an open-file-description lock for writing on the whole file; the kernel releases it with the last descriptor.
bool lock(int fd);
// Returns true if the path still names the open file.
bool is_still_named(int fd, const std::string& path);

// Holds the lock `path` until its end and then removes the file. A file that a killed process left is taken over.
class LockFile {
public:
    enum class State {
        held,
        busy,    // another process holds it
        foreign  // another user's file, or no file: without information, and no lock is held
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
