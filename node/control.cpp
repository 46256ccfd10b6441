#include "node/control.hpp"

#include <fmt/format.h>
#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <sstream>

#include "node/log.hpp"

namespace tactiled {
namespace {

constexpr int kLookMs = 100;       // how long stop() may wait
constexpr int kAnswerMs = 15'000;  // longer than the longest tare

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

}  // namespace

ControlSocket::ControlSocket(const std::string& path, const std::string& group, const std::string& node_name,
                             Ring<Command>& commands)
    : path_(path), node_name_(node_name), commands_(commands) {
    std::error_code ignored;
    std::filesystem::create_directories(std::filesystem::path(path).parent_path(), ignored);
    ::unlink(path.c_str());  // we hold the segment's lock: whoever made this socket is dead
    listener_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const sockaddr_un address = address_of(path);
    if (listener_ < 0 || ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::chmod(path.c_str(), 0660) != 0 || ::listen(listener_, 4) != 0) {
        const std::string why = std::strerror(errno);
        if (listener_ >= 0) ::close(listener_);
        throw SetupError(fmt::format("control socket {}: {}", path, why));
    }
    if (!group.empty())
        if (const ::group* found = ::getgrnam(group.c_str()))
            if (::chown(path.c_str(), uid_t(-1), found->gr_gid) != 0)
                log_line(LogLevel::warning,
                         fmt::format("control socket {}: group {}: {}", path, group, std::strerror(errno)));
    thread_ = std::thread([this] { serve(); });
}

ControlSocket::~ControlSocket() {
    stop_.store(true);
    thread_.join();
    ::close(listener_);
    ::unlink(path_.c_str());
}

void ControlSocket::serve() noexcept {
    while (!stop_.load()) {
        if (!wait_readable(listener_, kLookMs)) continue;
        const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (client < 0) {
            std::this_thread::sleep_for(std::chrono::milliseconds(kLookMs));  // out of descriptors: do not spin
            continue;
        }
        char request[128];
        if (wait_readable(client, kLookMs)) {
            const ssize_t size = ::recv(client, request, sizeof request, 0);
            if (size > 0) {
                const std::string reply = answer(std::string(request, std::size_t(size)));
                [[maybe_unused]] const auto sent = ::send(client, reply.data(), reply.size(), MSG_NOSIGNAL);
            }
        }
        ::close(client);
    }
}

std::string ControlSocket::answer(const std::string& request) noexcept {
    std::istringstream words(request);
    std::string node, verb, mask, more;
    words >> node >> verb >> mask >> more;
    if (node != node_name_) return fmt::format("{} {}", int(TACTILED_COMMAND_REJECTED), int(TACTILED_COMMAND_UNKNOWN));
    Command command;
    char* end = nullptr;
    const unsigned long value = std::strtoul(mask.c_str(), &end, 0);
    command.mask = std::uint32_t(value);
    const bool mask_good = !mask.empty() && *end == 0 && more.empty() && value <= UINT32_MAX;
    if (verb == "tare" && mask_good)
        command.kind = Command::Kind::tare;
    else if (verb == "untare" && mask_good)
        command.kind = Command::Kind::untare;
    else if (verb == "clear" && mask.empty())
        command.kind = Command::Kind::clear_latches;
    else
        return fmt::format("{} {}", int(TACTILED_COMMAND_REJECTED), int(TACTILED_COMMAND_UNKNOWN));
    return carry_out(command);
}

std::string ControlSocket::carry_out(Command command) noexcept {
    std::string why;
    const Segment segment = Segment::try_open(node_name_, why);
    command.number = ++number_;
    Command* const slot = commands_.claim();
    if (!segment.is_open() || slot == nullptr)
        return fmt::format("{} {}", int(TACTILED_COMMAND_REJECTED), int(TACTILED_COMMAND_NOT_NOW));
    *slot = command;
    commands_.push();
    commands_.commit();
    const std::uint64_t until = monotonic_ns() + std::uint64_t(kAnswerMs) * 1'000'000u;
    while (monotonic_ns() < until && !stop_.load()) {
        tactiled_node node{};
        if (segment.latest_node(node) && node.command_acknowledged == command.number &&
            node.command_state != TACTILED_COMMAND_RUNNING)
            return fmt::format("{} {}", node.command_state, node.command_result);
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return fmt::format("{} {}", int(TACTILED_COMMAND_DONE), int(TACTILED_COMMAND_TIMED_OUT));
}

std::string ask_daemon(const std::string& path, const std::string& request, int timeout_ms, std::string& why) {
    const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    const sockaddr_un address = address_of(path);
    std::string reply;
    if (fd < 0 || ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::send(fd, request.data(), request.size(), MSG_NOSIGNAL) < 0) {
        why = path + ": " + std::strerror(errno);
    } else if (!wait_readable(fd, timeout_ms)) {
        why = fmt::format("{}: no answer within {} ms", path, timeout_ms);
    } else {
        char buffer[128];
        const ssize_t size = ::recv(fd, buffer, sizeof buffer, 0);
        if (size > 0)
            reply.assign(buffer, std::size_t(size));
        else
            why = path + ": the daemon closed the connection";
    }
    if (fd >= 0) ::close(fd);
    return reply;
}

}  // namespace tactiled
