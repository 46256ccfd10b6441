#include "node/shm/lock_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "tactiled/reader.hpp"

namespace tactiled {

bool lock(int fd) {
    struct flock whole {};
    whole.l_type = F_WRLCK;
    whole.l_whence = SEEK_SET;
    return ::fcntl(fd, F_OFD_SETLK, &whole) == 0;
}

bool is_still_named(int fd, const std::string& path) {
    struct stat opened {
    }, named{};
    return ::fstat(fd, &opened) == 0 && ::lstat(path.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
           opened.st_dev == named.st_dev;
}

LockFile::State LockFile::take(int patience_ms) {
    for (const std::uint64_t until_ns = monotonic_ns() + std::uint64_t(patience_ms) * 1'000'000u;;) {
        Descriptor fd(::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600));
        struct stat status {};
        if (fd < 0 || ::fstat(fd, &status) != 0 || status.st_uid != ::geteuid() || !S_ISREG(status.st_mode))
            return State::foreign;
        const bool is_locked = lock(fd);
        if (!is_locked && errno != EAGAIN && errno != EACCES) return State::foreign;  // a file system without locks
        if (is_locked && is_still_named(fd, path_)) {
            fd_ = std::move(fd);
            return State::held;
        }
        if (monotonic_ns() >= until_ns) return State::busy;
        ::usleep(1000);
    }
}

LockFile::~LockFile() {
    // unlinked while the lock is held, so that a waiting process detects the missing name and opens the file again
    if (fd_ >= 0) ::unlink(path_.c_str());
}

}  // namespace tactiled
