#include "node/modbus/connection.hpp"

#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace tactiled::modbus {

const char* Connection::serve(const Answer& answer, std::uint64_t now_ns) {
    if (request_waits_ && !has_room(now_ns)) return "";
    if (const char* why = receive(now_ns); *why != 0) return why;
    if (const char* why = answer_all(answer, now_ns); *why != 0) return why;
    return peer_finished_ && !request_waits_ ? "closed by the client" : "";
}

// Makes room for kMaxAtOnce more answers. A client that waits for each answer never needs this.
bool Connection::has_room(std::uint64_t now_ns) noexcept {
    pollfd room{fd_, POLLOUT, 0};
    if (::poll(&room, 1, 0) == 1)
        stuck_since_ns_ = 0;
    else if (stuck_since_ns_ == 0)
        stuck_since_ns_ = now_ns;
    return stuck_since_ns_ == 0;
}

const char* Connection::receive(std::uint64_t now_ns) {
    if (peer_finished_ || received_ == in_.size()) return "";
    const ssize_t size = ::recv(fd_, in_.data() + received_, in_.size() - received_, MSG_DONTWAIT);
    if (size < 0) return errno == EAGAIN || errno == EINTR ? "" : "connection broken";
    // the client may have shut down only its own direction, and still gets the answers to its requests
    peer_finished_ = size == 0;
    received_ += std::size_t(size);
    if (size > 0) heard_ns_ = now_ns;
    return "";
}

const char* Connection::answer_all(const Answer& answer, std::uint64_t now_ns) {
    std::size_t used = 0;
    const char* why = "";
    request_waits_ = false;
    for (int n = 0;; ++n) {
        std::size_t size = 0;
        const std::span<const std::uint8_t> rest(in_.data() + used, received_ - used);
        const Cut cut = cut_adu(rest, size);
        if (cut == Cut::close) why = "not Modbus/TCP";
        if (cut != Cut::adu) break;
        request_waits_ = n == kMaxAtOnce || now_ns < held_until_ns();
        if (request_waits_) break;
        account_ns_ = std::max(account_ns_, now_ns) + cost_ns_;
        if (answer(rest.first(size)) == 0) return "takes no answers";
        used += size;
        asked_ns_ = now_ns;
        has_asked_ = true;
    }
    std::memmove(in_.data(), in_.data() + used, received_ - used);
    received_ -= used;
    if (received_ == 0 || request_waits_)
        request_began_ns_ = 0;
    else if (request_began_ns_ == 0 || used != 0)
        request_began_ns_ = now_ns;
    return why;
}

std::uint32_t Connection::interest() const noexcept {
    if (stuck_since_ns_ != 0) return EPOLLOUT;  // a client that takes no answers is not read from, either
    return received_ < in_.size() && !peer_finished_ ? std::uint32_t(EPOLLIN) : 0u;
}

const char* Connection::overdue(std::uint64_t now_ns) const noexcept {
    const auto late = [&](std::uint64_t since, std::uint64_t limit) { return since != 0 && now_ns > since + limit; };
    if (late(stuck_since_ns_, kStuckNs)) return "takes no answers";
    if (late(request_began_ns_, kRequestNs)) return "half a request for a second";
    if (!request_waits_ && late(heard_ns_, kIdleNs)) return "idle";
    return "";
}

}  // namespace tactiled::modbus
