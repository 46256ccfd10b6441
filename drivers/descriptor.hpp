// The owner of a file descriptor, which closes it.
#pragma once
#include <unistd.h>

#include <utility>

namespace tactiled {

class Descriptor {
public:
    explicit Descriptor(int fd = -1) noexcept : fd_(fd) {}  // -1: none
    Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    Descriptor& operator=(Descriptor&& other) noexcept {
        reset(std::exchange(other.fd_, -1));
        return *this;
    }
    ~Descriptor() { reset(); }

    operator int() const noexcept { return fd_; }
    // Closes the descriptor and owns `fd` instead.
    void reset(int fd = -1) noexcept {
        if (fd_ >= 0) ::close(fd_);
        fd_ = fd;
    }
    // Returns the descriptor, which the caller now owns.
    [[nodiscard]] int release() noexcept { return std::exchange(fd_, -1); }

private:
    int fd_;
};

}  // namespace tactiled
