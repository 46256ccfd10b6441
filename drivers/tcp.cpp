#include "drivers/tcp.hpp"

#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "drivers/descriptor.hpp"

namespace tactiled {
namespace {

// Maximum time until the other end acknowledges bytes; then the connection ends, because a disconnected cable causes no
// event.
constexpr int kUnacknowledgedMs = 3500;

// A disconnected cable would not be detected on a connection without traffic from this end. After 2 s of silence a
// keep-alive probe is sent each second. With TCP_USER_TIMEOUT set, that ends the connection (not TCP_KEEPCNT): here
// after two probes without an answer.
constexpr int kKeepAlive = 1, kAskAfterS = 2, kAskEveryS = 1;

const char* remedy(int error) {
    switch (error) {
        case ECONNREFUSED:
            return " (no program listens on this port: is the port right, and the service switched on in the device?)";
        case ETIMEDOUT: return " (is it powered and on this network? ping it)";
        case EHOSTUNREACH:
        case ENETUNREACH: return " (no way there: is this computer's address in the device's network?)";
        default: return "";
    }
}

}  // namespace

TcpAddress tcp_address(const std::string& text, unsigned default_port) {
    TcpAddress address;
    std::string host = text, port = std::to_string(default_port);
    const bool bracketed = !text.empty() && text.front() == '[' && text.find(']') != std::string::npos;
    if (const std::size_t colon = bracketed ? text.find("]:") : text.rfind(':'); colon != std::string::npos) {
        host = text.substr(0, colon + (bracketed ? 1 : 0));
        port = text.substr(colon + (bracketed ? 2 : 1));
    }
    if (bracketed) host = host.substr(1, host.find(']') - 1);
    addrinfo hints{}, *found = nullptr;
    hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
    hints.ai_socktype = SOCK_STREAM;
    const bool number = !port.empty() && port.size() <= 5 &&
                        std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (!number || std::stoi(port) < 1 || std::stoi(port) > 65535 || host.empty() ||
        ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found) != 0) {
        address.fault = fmt::format("should be a numeric address and a port, such as \"192.168.1.1:{}\" or \"[fd00::1]:{}\"",
                                    default_port, default_port);
        return address;
    }
    std::memcpy(&address.bytes, found->ai_addr, found->ai_addrlen);
    address.size = found->ai_addrlen;
    ::freeaddrinfo(found);
    return address;
}

int open_tcp(const TcpAddress& address, const std::string& text, int timeout_ms, std::string& why) {
    Descriptor fd(::socket(address.bytes.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const auto fail = [&](int error) {
        why = fmt::format("{}: {}{}", text, std::strerror(error), remedy(error));
        return -1;
    };
    if (fd < 0) return fail(errno);
    const int on = 1;
    if (::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on) != 0 ||
        ::setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &kUnacknowledgedMs, sizeof kUnacknowledgedMs) != 0 ||
        ::setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &kKeepAlive, sizeof kKeepAlive) != 0 ||
        ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &kAskAfterS, sizeof kAskAfterS) != 0 ||
        ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &kAskEveryS, sizeof kAskEveryS) != 0)
        return fail(errno);
    if (::connect(fd, reinterpret_cast<const sockaddr*>(&address.bytes), address.size) == 0) return fd.release();
    if (errno != EINPROGRESS) return fail(errno);
    pollfd waiting{fd, POLLOUT, 0};
    const int ready = ::poll(&waiting, 1, timeout_ms);
    if (ready <= 0) return fail(ready == 0 ? ETIMEDOUT : errno);
    int error = 0;
    socklen_t size = sizeof error;
    if (::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) != 0) error = errno;
    return error == 0 ? fd.release() : fail(error);
}

}  // namespace tactiled
