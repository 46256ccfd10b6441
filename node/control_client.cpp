#include "node/control_client.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>

#include "drivers/descriptor.hpp"

namespace tactiled {

sockaddr_un address_of(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    return address;
}

bool wait_readable(int fd, int timeout_ms) {
    pollfd p{fd, POLLIN, 0};
    return ::poll(&p, 1, timeout_ms) == 1;
}

std::string ask_daemon(const std::string& path, const std::string& request, int timeout_ms, std::string& why) {
    const Descriptor fd(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    const sockaddr_un address = address_of(path);
    // limits connect(), which blocks if the daemon hangs and its queue is full
    const timeval limit{timeout_ms / 1000, timeout_ms % 1000 * 1000L};
    ::setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    std::string reply;
    if (fd < 0 || ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::send(fd, request.data(), request.size(), MSG_NOSIGNAL) < 0) {
        why = path + ": " + std::strerror(errno);
    } else if (!wait_readable(fd, timeout_ms)) {
        why = fmt::format("{}: no answer within {} ms", path, timeout_ms);
    } else {
        char buffer[4096];  // a path, or an error in a file
        const ssize_t size = ::recv(fd, buffer, sizeof buffer, 0);
        if (size > 0)
            reply.assign(buffer, std::size_t(size));
        else
            why = path + ": the daemon closed the connection";
    }
    return reply;
}

}  // namespace tactiled
