#include "node/modbus/connection.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace tactiled::modbus {

Connection::~Connection() { ::close(fd_); }

const char* Connection::serve(const Answer& answer, std::uint64_t now_ns) {
    if (const char* why = receive(now_ns); *why != 0) return why;
    if (const char* why = answer_all(answer, now_ns); *why != 0) return why;
    return send(now_ns);
}

const char* Connection::receive(std::uint64_t now_ns) {
    if (received_ == in_.size()) return "";
    const ssize_t size = ::recv(fd_, in_.data() + received_, in_.size() - received_, MSG_DONTWAIT);
    if (size == 0) return "closed by the client";
    if (size < 0) return errno == EAGAIN || errno == EINTR ? "" : "connection broken";
    received_ += std::size_t(size);
    heard_ns_ = now_ns;
    return "";
}

const char* Connection::answer_all(const Answer& answer, std::uint64_t now_ns) {
    std::size_t used = 0;
    const char* why = "";
    backlog_ = false;
    for (int n = 0; *why == 0; ++n) {
        std::size_t size = 0;
        const std::span<const std::uint8_t> rest(in_.data() + used, received_ - used);
        const Cut cut = cut_adu(rest, size);
        if (cut == Cut::close) why = "not Modbus/TCP";
        if (cut != Cut::adu) break;
        if (n == kMostAtOnce || out_.size() - sent_ >= kMostWaiting) {
            backlog_ = out_.size() - sent_ < kMostWaiting;  // else the client must take its answers first
            break;
        }
        std::array<std::uint8_t, kMostAdu> reply;
        const std::size_t length = answer(rest.first(size), reply);
        out_.insert(out_.end(), reply.begin(), reply.begin() + std::ptrdiff_t(length));
        used += size;
    }
    std::memmove(in_.data(), in_.data() + used, received_ - used);
    received_ -= used;
    if (received_ == 0)
        request_began_ns_ = 0;
    else if (request_began_ns_ == 0 || used != 0)
        request_began_ns_ = now_ns;
    return why;
}

const char* Connection::send(std::uint64_t now_ns) {
    if (!wants_to_send()) return "";
    const ssize_t size = ::send(fd_, out_.data() + sent_, out_.size() - sent_, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (size < 0 && errno != EAGAIN && errno != EINTR) return "connection broken";
    if (size > 0) {
        sent_ += std::size_t(size);
        stuck_since_ns_ = 0;
        request_began_ns_ = received_ != 0 ? now_ns : 0;  // what waited for us is not the client's delay
    }
    if (!wants_to_send()) {
        out_.clear();
        sent_ = 0;
    } else if (stuck_since_ns_ == 0) {
        stuck_since_ns_ = now_ns;
    }
    return "";
}

const char* Connection::overdue(std::uint64_t now_ns) const noexcept {
    const auto late = [&](std::uint64_t since, std::uint64_t limit) { return since != 0 && now_ns > since + limit; };
    if (late(stuck_since_ns_, kDeafNs)) return "takes no answers";
    if (!wants_to_send() && !backlog_ && late(request_began_ns_, kRequestNs)) return "half a request for a second";
    if (late(heard_ns_, kIdleNs)) return "idle";
    return "";
}

}  // namespace tactiled::modbus
