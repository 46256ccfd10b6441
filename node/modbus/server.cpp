#include "node/modbus/server.hpp"

#include <fmt/format.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "config/network_address.hpp"
#include "drivers/clock.hpp"
#include "node/log.hpp"

namespace tactiled {
namespace {

// Longest delay of time limits, and the same without a client: half of kAwayNs.
constexpr std::uint64_t kTickNs = 50'000'000, kIdleTickNs = 500'000'000;
constexpr std::uint64_t kAnyTime = ~std::uint64_t(0);
// A command that waited for so long while the process or the machine stood still is not carried out: its sender has given
// up.
constexpr std::uint64_t kAwayNs = 1'000'000'000, kDrainNs = 200'000'000;
constexpr std::uint64_t kRetryNs = 1'000'000'000;  // for the port, and after running out of descriptors
// A client keeps its place for this time after a complete request, against newcomers of hosts that hold as many places.
// PLCs poll every 2 s or faster.
constexpr std::uint64_t kKeepsPlaceNs = 5'000'000'000;
constexpr int kBacklog = 128;  // a client for which the kernel has no room tries again after a second
// Connections of each listed address: a PLC has one or two, and as many may be left over from before it was switched off,
// until keep-alive closes them after 11 s.
constexpr std::size_t kPlacesOfPlc = 4;
// A host gives a place to a newcomer if it holds so many more than the newcomer's host. After the exchange it still holds as
// many; with a difference of one, two hosts would take the last place from each other for ever.
constexpr std::size_t kGivesAtMore = 2;

void watch(int epoll, int operation, int fd, std::uint32_t events) {
    epoll_event event{};
    event.events = events;
    event.data.fd = fd;
    ::epoll_ctl(epoll, operation, fd, &event);
}

}  // namespace

ModbusServer::ModbusServer(std::string node_name, const ModbusSettings& settings, CommandRing& commands)
    : settings_(settings),
      allowed_(settings.allow),
      plcs_(settings.plc),
      writers_(settings.command_allow),
      service_(std::move(node_name), settings, commands),
      line_(settings.rtu) {
    epoll_.reset(::epoll_create1(EPOLL_CLOEXEC));
    ticks_.reset(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
    if (epoll_ < 0 || ticks_ < 0 || !set_tick(kTickNs))
        throw SetupError(fmt::format("Modbus: epoll, timer: {}", std::strerror(errno)));
    watch(epoll_, EPOLL_CTL_ADD, ticks_, EPOLLIN);
    line_.session.may_write = settings.commands;  // every device on the wire is allowed
    if (!settings_.listen.empty()) try_to_listen(monotonic_ns());
    listens_from_the_start_ = settings_.listen.empty() || listener_ >= 0;
    if (!settings_.rtu.device.empty()) serve_line(monotonic_ns(), false);
    looked_ns_ = with_suspend_ns();
    thread_.start("modbus", 0, -1, [this] { serve(); });
}

ModbusServer::~ModbusServer() {
    stop_.store(true);
    const itimerspec now{{}, {0, 1}};
    ::timerfd_settime(ticks_, 0, &now, nullptr);  // ends the wait of the thread
    thread_.join();
}

void ModbusServer::serve() noexcept {
    while (!stop_.load()) try {
            cycle();
        } catch (const std::exception& error) {  // no memory: unfinished work is repeated in the next cycle
            if (monotonic_ns() >= complain_again_ns_) log_line(LogLevel::warning, "Modbus: {}", error.what());
            complain_again_ns_ = monotonic_ns() + kRetryNs;
            sleep_until(monotonic_ns() + kTickNs);
        }
}

void ModbusServer::cycle() {
    std::array<epoll_event, 64> events;
    const int n = wait_for(events);
    const std::uint64_t now_ns = monotonic_ns(), looked_before_ns = std::exchange(looked_ns_, with_suspend_ns());
    if (looked_ns_ - looked_before_ns > kAwayNs) service_.refuse_writes_until(now_ns + kDrainNs);
    bool line_readable = false, client_waits = false, ticked = false;
    for (int i = 0; i < n; ++i) {
        const auto& event = events[std::size_t(i)];
        if (event.data.fd == ticks_)
            ticked = true;
        else if (event.data.fd == watched_line_)
            line_readable = true;
        else if (event.data.fd == listener_)
            client_waits = true;  // after the batch, which may have events of a closed descriptor
        else
            serve_client(event.data.fd, event.events, now_ns);
    }
    if (client_waits) accept_all(now_ns);
    if (!settings_.rtu.device.empty()) serve_line(monotonic_ns(), line_readable);
    serve_held_back(now_ns);
    if (ticked) tick(now_ns);
    const bool is_idle = clients_.empty() && settings_.rtu.device.empty() && !service_.watches_plc();
    (void)set_tick(is_idle ? kIdleTickNs : kTickNs);
}

bool ModbusServer::set_tick(std::uint64_t interval_ns) noexcept {
    if (interval_ns == tick_ns_) return true;
    tick_ns_ = interval_ns;
    const itimerspec tick{{0, long(interval_ns)}, {0, long(interval_ns)}};
    return ::timerfd_settime(ticks_, 0, &tick, nullptr) == 0;
}

// Normally waits without a time limit: a limit makes each wait cost several microseconds more on a virtual machine.
int ModbusServer::wait_for(std::span<epoll_event> events) const noexcept {
    const std::uint64_t now_ns = monotonic_ns(), due_ns = next_due_ns();
    if (due_ns == kAnyTime) return ::epoll_wait(epoll_, events.data(), int(events.size()), -1);
    const std::uint64_t wait_ns = due_ns > now_ns ? std::min(due_ns - now_ns, kTickNs) : 0;
    const timespec wait{0, long(wait_ns)};
    const int n = ::epoll_pwait2(epoll_, events.data(), int(events.size()), &wait, nullptr);
    if (n >= 0 || errno == EINTR) return n;  // else a kernel before 5.11, or a filter that does not know the call
    return ::epoll_wait(epoll_, events.data(), int(events.size()), int((wait_ns + 999'999) / 1'000'000));
}

void ModbusServer::tick(std::uint64_t now_ns) {
    std::uint64_t ticks = 0;
    (void)!::read(ticks_, &ticks, sizeof ticks);
    if (!settings_.listen.empty() && listener_ < 0 && now_ns >= listen_again_ns_) try_to_listen(now_ns);
    if (accepting_paused_ && now_ns >= listen_again_ns_) {
        accepting_paused_ = false;
        watch(epoll_, EPOLL_CTL_ADD, listener_, EPOLLIN);
    }
    close_overdue(now_ns);
}

std::uint64_t ModbusServer::next_due_ns() const noexcept {
    std::uint64_t due_ns = kAnyTime;
    for (const auto& [fd, client] : clients_)
        if (const std::uint64_t at_ns = client->backlog_ns(); at_ns != 0) due_ns = std::min(due_ns, at_ns);
    if (const std::uint64_t at_ns = line_.due_ns(); at_ns != 0 && !settings_.rtu.device.empty())
        due_ns = std::min(due_ns, at_ns);
    return due_ns;
}

// Serves clients whose requests wait because of the limit per call or because of their rate.
void ModbusServer::serve_held_back(std::uint64_t now_ns) {
    std::array<int, 256> due;
    std::size_t n = 0;
    for (const auto& [fd, client] : clients_)
        if (client->backlog_ns() != 0 && client->backlog_ns() <= now_ns && n < due.size()) due[n++] = fd;
    for (std::size_t i = 0; i < n; ++i) serve_client(due[i], 0, now_ns);
}

void ModbusServer::serve_line(std::uint64_t now_ns, bool readable) {
    if (readable && !line_.receive(now_ns)) watched_line_ = -1;  // closed: epoll has removed it
    line_.tick([this](auto frame) { return service_.answer(frame, line_.session, line_.responder); }, now_ns);
    if (line_.fd() >= 0 && watched_line_ < 0) watch(epoll_, EPOLL_CTL_ADD, watched_line_ = line_.fd(), EPOLLIN);
}

// ---- the port --------------------------------------------------------------------------------------------------------

void ModbusServer::try_to_listen(std::uint64_t now_ns) {
    const ListenAddress address = check_listen_address(settings_.listen);
    const int one = 1;
    listener_.reset(::socket(address.bytes.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (listener_ >= 0) ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (listener_ >= 0 && ::bind(listener_, reinterpret_cast<const sockaddr*>(&address.bytes), address.size) == 0 &&
        ::listen(listener_, kBacklog) == 0) {
        watch(epoll_, EPOLL_CTL_ADD, listener_, EPOLLIN);
        if (!complaint_.empty()) log_line(LogLevel::info, "Modbus: listening on {}", settings_.listen);
        complaint_.clear();
        return;
    }
    const std::string why = fmt::format("Modbus: {}: {}; trying again each second", settings_.listen, std::strerror(errno));
    if (why != complaint_) log_text(LogLevel::warning, why);
    complaint_ = why;
    listener_.reset();
    listen_again_ns_ = now_ns + kRetryNs;
}

// Fills the free places, or judges one client where there is none. The next cycle goes on, after it has closed clients
// that hung up while they waited: they take no place from one that asks.
void ModbusServer::accept_all(std::uint64_t now_ns) {
    const auto places = std::size_t(settings_.max_clients);
    const std::size_t most = clients_.size() < places ? places - clients_.size() : 1;
    for (std::size_t n = 0; n < most; ++n) {
        sockaddr_storage peer{};
        socklen_t size = sizeof peer;
        Descriptor fd(::accept4(listener_, reinterpret_cast<sockaddr*>(&peer), &size, SOCK_NONBLOCK | SOCK_CLOEXEC));
        if (fd < 0) {
            if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS) {
                watch(epoll_, EPOLL_CTL_DEL, listener_, 0);  // the waiting client would wake the thread again and again
                listen_again_ns_ = now_ns + kRetryNs;
                accepting_paused_ = true;
            }
            if (errno != EINTR && errno != ECONNABORTED) return;
            continue;
        }
        const bool plc = !settings_.plc.empty() && plcs_.allows(peer);
        if ((!plc && !allowed_.allows(peer)) || !make_room(peer, plc, now_ns)) {
            ++counts_.refused;
            continue;
        }
        const int one = 1, keep_idle_s = 5, keep_interval_s = 2, keep_count = 3;
        const int send_buffer = modbus::Connection::kSendBuffer;
        ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &send_buffer, sizeof send_buffer);
        ::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        // the place of a disconnected cable is freed after about 11 s
        ::setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &one, sizeof one);
        ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &keep_idle_s, sizeof keep_idle_s);
        ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &keep_interval_s, sizeof keep_interval_s);
        ::setsockopt(fd, IPPROTO_TCP, TCP_KEEPCNT, &keep_count, sizeof keep_count);
        try {
            admit(fd, peer, plc, now_ns);
            (void)fd.release();
        } catch (const std::bad_alloc&) {
            clients_.erase(fd);
            ++counts_.refused;
        }
    }
}

// Takes over the descriptor after everything that may fail.
void ModbusServer::admit(int fd, const sockaddr_storage& peer, bool plc, std::uint64_t now_ns) {
    auto& client = clients_[fd];
    client = std::make_unique<Client>(fd, now_ns, settings_.max_requests_per_s, peer, plc);
    client->session.host = modbus::host_of(peer);
    client->session.may_write = settings_.command_allow.empty() || writers_.allows(peer);
    watch(epoll_, EPOLL_CTL_ADD, fd, client->watched = EPOLLIN);
    ++counts_.accepted;
}

// Returns how many places of the same kind a host holds: reserved ones of listed PLCs, or others.
std::size_t ModbusServer::places_of(const sockaddr_storage& host, bool plc) const {
    return std::size_t(std::count_if(clients_.begin(), clients_.end(), [&](const auto& entry) {
        return entry.second->plc == plc && modbus::same_host(entry.second->peer, host);
    }));
}

// Closes the client without a complete request for the longest time, of those that may lose their place: first one that
// has never sent a request, then one of a host with kGivesAtMore more places than the newcomer's, then one that is idle.
// Idle clients, and many of one host, therefore keep no other host out, and the only client of a host keeps its place while
// it polls. A listed PLC has reserved places, of which it loses its own oldest at once, because a PLC that was switched off
// leaves connections behind.
bool ModbusServer::make_room(const sockaddr_storage& peer, bool plc, std::uint64_t now_ns) {
    const std::size_t held = places_of(peer, plc);
    const auto of_kind = [&](const auto& entry) { return entry.second->plc == plc; };
    const auto taken = plc ? held : std::size_t(std::count_if(clients_.begin(), clients_.end(), of_kind));
    if (taken < (plc ? kPlacesOfPlc : std::size_t(settings_.max_clients))) return true;
    const auto close_oldest = [&](auto&& may_lose) {
        int oldest = -1;
        for (const auto& [fd, client] : clients_)
            if (client->plc == plc && may_lose(*client) && (oldest < 0 || client->asked_ns() < clients_[oldest]->asked_ns()))
                oldest = fd;
        if (oldest >= 0) close(oldest);
        return oldest >= 0;
    };
    if (plc) return close_oldest([&](const Client& c) { return modbus::same_host(c.peer, peer); });
    return close_oldest([](const Client& c) { return !c.has_asked(); }) ||
           close_oldest([&](const Client& c) { return places_of(c.peer, false) >= held + kGivesAtMore; }) ||
           close_oldest([&](const Client& c) { return now_ns - c.asked_ns() >= kKeepsPlaceNs; });
}

// ---- the clients -----------------------------------------------------------------------------------------------------

void ModbusServer::serve_client(int fd, std::uint32_t events, std::uint64_t now_ns) {
    const auto found = clients_.find(fd);
    if (found == clients_.end()) return;
    Client& client = *found->second;
    tcp_.set_descriptor(fd);
    const auto answer = [&](auto adu) { return service_.answer(adu, client.session, tcp_); };
    const char* why = "no memory";
    try {
        why = client.serve(answer, now_ns);
    } catch (const std::bad_alloc&) {}                                         // the number of answered requests is unknown
    if (*why != 0 || (events & (EPOLLERR | EPOLLHUP)) != 0) return close(fd);  // hung up: further answers would be lost
    if (client.interest() != client.watched) watch(epoll_, EPOLL_CTL_MOD, fd, client.watched = client.interest());
}

void ModbusServer::close_overdue(std::uint64_t now_ns) {
    service_.tick(now_ns);
    std::vector<int> overdue;
    for (const auto& [fd, client] : clients_)
        if (*client->overdue(now_ns) != 0) overdue.push_back(fd);
    for (const int fd : overdue) close(fd);
}

void ModbusServer::close(int fd) {
    clients_.erase(fd);  // closes the descriptor, which removes it from epoll
    ++counts_.closed;
}

}  // namespace tactiled
