#include "node/modbus/server.hpp"

#include <fmt/format.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

#include "node/log.hpp"

namespace tactiled {
namespace {

constexpr int kTurnMs = 50;                               // how long stop() and deadlines may wait
constexpr std::uint64_t kRetryNs = 1'000'000'000;         // for the port, and after running out of descriptors
constexpr std::uint64_t kMayBeEvictedNs = 1'000'000'000;  // a client that asked within the last second keeps its place

void watch(int epoll, int operation, int fd, std::uint32_t events) {
    epoll_event event{};
    event.events = events;
    event.data.fd = fd;
    ::epoll_ctl(epoll, operation, fd, &event);
}

}  // namespace

ModbusServer::ModbusServer(std::string node_name, const ModbusSettings& settings)
    : node_name_(std::move(node_name)), settings_(settings), allowed_(settings.allow) {
    epoll_ = ::epoll_create1(EPOLL_CLOEXEC);
    if (epoll_ < 0) throw SetupError(fmt::format("Modbus: epoll: {}", std::strerror(errno)));
    try_to_listen(monotonic_ns());
    thread_ = std::thread([this] { serve(); });
}

ModbusServer::~ModbusServer() {
    stop_.store(true);
    thread_.join();
    clients_.clear();
    stop_listening();
    ::close(epoll_);
}

void ModbusServer::serve() {
    std::array<epoll_event, 64> events;
    while (!stop_.load()) {
        const bool backlog =
            std::any_of(clients_.begin(), clients_.end(), [](const auto& c) { return c.second->has_backlog(); });
        const int n = ::epoll_wait(epoll_, events.data(), int(events.size()), backlog ? 0 : kTurnMs);
        const std::uint64_t now_ns = monotonic_ns();
        for (int i = 0; i < n; ++i) {
            if (events[std::size_t(i)].data.fd == listener_)
                accept_all(now_ns);
            else
                serve_client(events[std::size_t(i)].data.fd, now_ns);
        }
        if (backlog) {
            std::vector<int> waiting;
            for (const auto& [fd, client] : clients_)
                if (client->has_backlog()) waiting.push_back(fd);
            for (const int fd : waiting) serve_client(fd, now_ns);
        }
        if (listener_ < 0 && now_ns >= listen_again_ns_) try_to_listen(now_ns);
        if (looks_away_ && now_ns >= listen_again_ns_) {
            looks_away_ = false;
            watch(epoll_, EPOLL_CTL_ADD, listener_, EPOLLIN);
        }
        if (now_ns - looked_for_overdue_ns_ >= std::uint64_t(kTurnMs) * 1'000'000u) close_overdue(now_ns);
    }
}

// ---- the port --------------------------------------------------------------------------------------------------------

void ModbusServer::try_to_listen(std::uint64_t now_ns) {
    socklen_t size = 0;
    const sockaddr_storage address = modbus::listen_address(settings_.listen, size);
    const int one = 1;
    listener_ = ::socket(address.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (listener_ >= 0) ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (listener_ >= 0 && ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), size) == 0 &&
        ::listen(listener_, 16) == 0) {
        watch(epoll_, EPOLL_CTL_ADD, listener_, EPOLLIN);
        if (!complaint_.empty()) log_line(LogLevel::info, fmt::format("Modbus: listening on {}", settings_.listen));
        complaint_.clear();
        return;
    }
    const std::string why = fmt::format("Modbus: {}: {}; trying again each second", settings_.listen, std::strerror(errno));
    if (why != complaint_) log_line(LogLevel::warning, why);
    complaint_ = why;
    stop_listening();
    listen_again_ns_ = now_ns + kRetryNs;
}

void ModbusServer::stop_listening() noexcept {
    if (listener_ >= 0) ::close(listener_);
    listener_ = -1;
}

void ModbusServer::accept_all(std::uint64_t now_ns) {
    for (int n = 0; n < 64; ++n) {
        sockaddr_storage peer{};
        socklen_t size = sizeof peer;
        const int fd = ::accept4(listener_, reinterpret_cast<sockaddr*>(&peer), &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (fd < 0) {
            if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS) {
                watch(epoll_, EPOLL_CTL_DEL, listener_, 0);  // the waiting client would wake us for ever
                listen_again_ns_ = now_ns + kRetryNs;
                looks_away_ = true;
            }
            if (errno != EINTR && errno != ECONNABORTED) return;
            continue;
        }
        if (!allowed_.allows(peer) || !make_room(now_ns)) {
            ++counts_.refused;
            ::close(fd);
            continue;
        }
        const int one = 1, keep_idle_s = 5, keep_interval_s = 2, keep_count = 3;
        const int waiting_bytes = 32 * 1024;  // of answers, in the kernel: a client that takes none is soon noticed
        ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &waiting_bytes, sizeof waiting_bytes);
        ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        ::setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &one, sizeof one);  // a pulled cable frees its place after about 11 s
        ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &keep_idle_s, sizeof keep_idle_s);
        ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &keep_interval_s, sizeof keep_interval_s);
        ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPCNT, &keep_count, sizeof keep_count);
        clients_[fd] = std::make_unique<modbus::Connection>(fd, now_ns);
        watch(epoll_, EPOLL_CTL_ADD, fd, EPOLLIN);
        ++counts_.accepted;
    }
}

// Who has never asked anything makes room first, then who has been silent longest. One that polls keeps its place, so a
// flood of connections pushes out only itself.
bool ModbusServer::make_room(std::uint64_t now_ns) {
    if (clients_.size() < std::size_t(settings_.max_clients)) return true;
    const auto worth = [](const auto& c) { return std::pair(c.second->has_asked(), c.second->heard_ns()); };
    const auto least = std::min_element(clients_.begin(), clients_.end(),
                                        [&](const auto& a, const auto& b) { return worth(a) < worth(b); });
    if (least->second->has_asked() && now_ns - least->second->heard_ns() < kMayBeEvictedNs) return false;
    close(least->first);
    return true;
}

// ---- the clients -----------------------------------------------------------------------------------------------------

void ModbusServer::serve_client(int fd, std::uint64_t now_ns) {
    const auto found = clients_.find(fd);
    if (found == clients_.end()) return;
    modbus::Connection& client = *found->second;
    const bool was_sending = client.wants_to_send();
    const char* why = client.serve([this](auto adu, auto out) { return answer(adu, out); }, now_ns);
    if (*why != 0) return close(fd);
    if (client.wants_to_send() != was_sending)  // a client that takes no answers is not read from either
        watch(epoll_, EPOLL_CTL_MOD, fd, client.wants_to_send() ? std::uint32_t(EPOLLOUT) : std::uint32_t(EPOLLIN));
}

void ModbusServer::close_overdue(std::uint64_t now_ns) {
    looked_for_overdue_ns_ = now_ns;
    std::vector<int> overdue;
    for (const auto& [fd, client] : clients_)
        if (*client->overdue(now_ns) != 0) overdue.push_back(fd);
    for (const int fd : overdue) close(fd);
}

void ModbusServer::close(int fd) {
    clients_.erase(fd);  // closes; epoll forgets it
    ++counts_.closed;
}

std::size_t ModbusServer::answer(std::span<const std::uint8_t> adu, std::span<std::uint8_t, modbus::kMostAdu> out) {
    ++counts_.requests;
    const modbus::Request request = modbus::check_adu(adu);
    if (request.exception != modbus::kNone) {
        ++counts_.exceptions;
        return modbus::exception_adu(adu, request.exception, out);
    }
    if (!segment_.is_open() || !segment_.is_current()) {
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns - segment_tried_ns_ >= kRetryNs / 10) {
            std::string why;
            segment_tried_ns_ = now_ns;
            if (Segment fresh = Segment::try_open(node_name_, why); fresh.is_open()) segment_ = std::move(fresh);
        }
    }
    const modbus::View view =
        segment_.is_open() ? modbus::view_of(segment_) : modbus::view_of_nothing();  // one frame a request
    const modbus::Area& area = *modbus::area_of(request.at, request.count);
    std::array<std::uint16_t, modbus::kSensorSize * modbus::kSensorBlocks> registers;
    const std::span<std::uint16_t> used(registers.data(), area.size);
    modbus::encode_area(view, area, used);
    return responder_.answer(adu, area, used, out);
}

}  // namespace tactiled
