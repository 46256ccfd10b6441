// A client's socket for a Responder, and the answers that arrive at its other end, separated from each other.
#pragma once
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>

namespace tactiled::test {

class AnswerSocket {
public:
    AnswerSocket() {
        if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends_.data()) != 0) std::abort();
    }
    ~AnswerSocket() {
        for (const int fd : ends_) ::close(fd);
    }
    AnswerSocket(const AnswerSocket&) = delete;
    AnswerSocket& operator=(const AnswerSocket&) = delete;

    [[nodiscard]] int fd() const { return ends_[0]; }
    // Takes the next answer; returns its length, 0 = none.
    std::size_t take(std::span<std::uint8_t> out) const {
        const ssize_t size = ::recv(ends_[1], out.data(), out.size(), MSG_DONTWAIT);
        return size > 0 ? std::size_t(size) : 0;
    }

private:
    std::array<int, 2> ends_{};
};

}  // namespace tactiled::test
