#include "node/modbus/connection.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace tactiled::modbus {

Connection::~Connection() { ::close(fd_); }

const char* Connection::serve(const Answer& answer, std::uint64_t now_ns) {
    if (const char* why = receive(now_ns); *why != 0) return why;
    if (const char* why = send(now_ns); *why != 0) return why;  // makes room for the answers to come
    const char* why = answer_all(answer, now_ns);
    if (const char* broken = send(now_ns); *broken != 0) return broken;  // also what was answered before garbage
    if (*why != 0) return why;
    return said_all_ && !request_waits_ && out_.empty() ? "closed by the client" : "";
}

const char* Connection::receive(std::uint64_t now_ns) {
    if (said_all_ || received_ == in_.size()) return "";
    const ssize_t size = ::recv(fd_, in_.data() + received_, in_.size() - received_, MSG_DONTWAIT);
    if (size < 0) return errno == EAGAIN || errno == EINTR ? "" : "connection broken";
    said_all_ = size == 0;  // it may have shut down its own direction only, and still gets what it has asked for
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
        request_waits_ = n == kMaxAtOnce || out_.size() >= kMaxWaiting || now_ns < held_until_ns();
        if (request_waits_) break;
        account_ns_ = std::max(account_ns_, now_ns) + cost_ns_;
        std::array<std::uint8_t, kMaxAdu> reply;
        const std::size_t length = answer(rest.first(size), reply);
        out_.insert(out_.end(), reply.begin(), reply.begin() + std::ptrdiff_t(length));
        used += size;
        asked_ = true;
    }
    std::memmove(in_.data(), in_.data() + used, received_ - used);
    received_ -= used;
    if (received_ == 0 || request_waits_)
        request_began_ns_ = 0;
    else if (request_began_ns_ == 0 || used != 0)
        request_began_ns_ = now_ns;
    return why;
}

const char* Connection::send(std::uint64_t now_ns) {
    if (!wants_to_send()) return "";
    const ssize_t size = ::send(fd_, out_.data(), out_.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (size < 0 && errno != EAGAIN && errno != EINTR) return "connection broken";
    if (size > 0) {
        out_.erase(out_.begin(), out_.begin() + size);
        stuck_since_ns_ = 0;
    }
    if (wants_to_send() && stuck_since_ns_ == 0) stuck_since_ns_ = now_ns;
    return "";
}

std::uint32_t Connection::interest() const noexcept {
    if (wants_to_send()) return EPOLLOUT;  // a client that takes no answers is not read from either
    return received_ < in_.size() && !said_all_ ? std::uint32_t(EPOLLIN) : 0u;
}

const char* Connection::overdue(std::uint64_t now_ns) const noexcept {
    const auto late = [&](std::uint64_t since, std::uint64_t limit) { return since != 0 && now_ns > since + limit; };
    if (late(stuck_since_ns_, kDeafNs)) return "takes no answers";
    if (!wants_to_send() && late(request_began_ns_, kRequestNs)) return "half a request for a second";
    if (!request_waits_ && !wants_to_send() && late(heard_ns_, kIdleNs)) return "idle";
    return "";
}

}  // namespace tactiled::modbus
