// A lock on an empty file that the kernel releases when the process ends.
#pragma once
#include <string>

#include "drivers/descriptor.hpp"

namespace tactiled {

// Takes an open-file-description lock for writing on the whole file. The kernel releases the lock with the last descriptor.
bool lock(int fd);
// Returns true if the path still names the open file.
bool is_still_named(int fd, const std::string& path);

// Holds the lock on `path` during its lifetime and then removes the file. The file of a killed process is taken over.
class LockFile {
public:
    enum class State {
        held,
        busy,    // another process holds the lock
        foreign  // the file belongs to another user or cannot be created or locked: no lock is held, and other holders are
                 // unknown
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
    Descriptor fd_;
};

}  // namespace tactiled
