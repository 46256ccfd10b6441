#include "node/control.hpp"

#include <fmt/format.h>
#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <optional>
#include <sstream>
#include <utility>

#include "config/names.hpp"
#include "node/control_client.hpp"
#include "node/log.hpp"
#include "node/objects.hpp"

namespace tactiled {
namespace {

constexpr int kLookMs = 1000;      // interval of the check for refused tares
constexpr int kPatienceMs = 100;   // for a client's request if its place is needed, and pause if no descriptor is available
constexpr int kAnswerMs = 15'000;  // longer than the longest tare
constexpr std::uint64_t kLogEachNs = 10'000'000'000;

void answer(int client, std::string_view text) {
    [[maybe_unused]] const auto sent = ::send(client, text.data(), text.size(), MSG_NOSIGNAL);
}

void answer(int client, std::uint32_t state, std::uint32_t result) { answer(client, fmt::format("{} {}", state, result)); }

void reject(int client, tactiled_command_result result, const std::string& why) {
    answer(client, fmt::format("{} {} {}", int(TACTILED_COMMAND_REJECTED), int(result), why));
}

// Returns true if the client has closed its end. A client that has only shut down writing still waits for the answer.
bool has_hung_up(int client) {
    pollfd p{client, 0, 0};
    return ::poll(&p, 1, 0) == 1 && (p.revents & (POLLHUP | POLLERR)) != 0;
}

// Returns the command for the argument of NODE weigh; nothing if the argument is invalid.
std::optional<Command> weigh_command(const std::string& word) {
    Command command;
    char* end = nullptr;
    command.mass_kg = std::strtod(word.c_str(), &end);
    command.kind = word == "start"  ? Command::Kind::start_weighing
                   : word == "stop" ? Command::Kind::stop_weighing
                   : word == "zero" ? Command::Kind::zero_weight
                                    : Command::Kind::known_weight;
    const bool mass = !word.empty() && *end == 0 && std::isfinite(command.mass_kg) && command.mass_kg > 0;
    const bool known = word == "forget" || mass;  // "forget" has no number and sends 0 kg
    if (command.kind == Command::Kind::known_weight && !known) return std::nullopt;
    return command;
}

// Sends "ok" with the descriptor, or "none" if it is -1.
void answer_with(int client, int descriptor) {
    char text[] = "ok";
    iovec part{text, 2};
    alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))]{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    if (descriptor < 0) return answer(client, "none");
    message.msg_control = control;
    message.msg_controllen = sizeof control;
    cmsghdr* const extra = CMSG_FIRSTHDR(&message);
    extra->cmsg_level = SOL_SOCKET;
    extra->cmsg_type = SCM_RIGHTS;
    extra->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(extra), &descriptor, sizeof descriptor);
    [[maybe_unused]] const auto sent = ::sendmsg(client, &message, MSG_NOSIGNAL);
}

}  // namespace

ControlSocket::ControlSocket(const std::string& path, const std::string& group, const std::string& node_name,
                             const SegmentWriter& segment, const std::string& objects_path, CommandRing& commands,
                             std::string config_path)
    : path_(path),
      lock_(path + ".lock"),
      node_name_(node_name),
      objects_path_(objects_path),
      config_path_(std::move(config_path)),
      writer_(segment),
      commands_(commands),
      events_(node_name, segment.wake_page()) {
    std::error_code ignored;
    std::filesystem::create_directories(std::filesystem::path(path).parent_path(), ignored);
    std::string unused;
    // The name of the node belongs to this daemon, but the configuration of another node may have the same path. The request
    // finds a daemon without the lock: an older version, or a daemon whose lock file is a file of another user.
    if (lock_.take(0) == LockFile::State::busy || !ask_daemon(path, "?", kPatienceMs, unused).empty())
        throw SetupError(
            fmt::format("control socket {}: another daemon uses it; give each daemon its own [node] control", path));
    struct stat there {};
    if (::lstat(path.c_str(), &there) == 0 && !S_ISSOCK(there.st_mode))  // a regular file that was named by mistake
        throw SetupError(fmt::format("control socket {}: the path is not a socket; choose another path", path));
    ::unlink(path.c_str());
    listener_.reset(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    const sockaddr_un address = address_of(path);
    if (listener_ < 0 || ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::chmod(path.c_str(), 0660) != 0 || ::listen(listener_, 16) != 0)
        throw SetupError(fmt::format("control socket {}: {}", path, std::strerror(errno)));
    if (::lstat(path.c_str(), &there) == 0) {
        device_ = there.st_dev;
        inode_ = there.st_ino;
    }
    if (!group.empty())
        if (const ::group* found = ::getgrnam(group.c_str()))
            if (::lchown(path.c_str(), uid_t(-1), found->gr_gid) != 0)
                log_line(LogLevel::warning, "control socket {}: group {}: {}", path, group, std::strerror(errno));
    segment_ = Segment::open(node_name);
    silent_.reserve(kPlaces);
    thread_.start("control", 0, -1, [this] { serve(); });
}

ControlSocket::~ControlSocket() {
    stop_.store(true);
    ::shutdown(listener_, SHUT_RDWR);  // ends poll() in the thread
    thread_.join();
    listener_.reset();
    struct stat there {};
    if (::lstat(path_.c_str(), &there) == 0 && there.st_dev == device_ && there.st_ino == inode_) ::unlink(path_.c_str());
}

void ControlSocket::serve() noexcept {
    std::array<pollfd, kPlaces + 1> watched;
    while (!stop_.load()) {
        const std::size_t n = silent_.size();
        for (std::size_t i = 0; i < n; ++i) watched[i] = {silent_[i].client, POLLIN, 0};
        const int room_ms = room_in_ms();
        watched[n] = {room_ms == 0 ? int(listener_) : -1, POLLIN, 0};  // -1: a newcomer waits in the queue of the kernel
        const int look_ms = asker_ >= 0 ? 1 : kLookMs;
        ::poll(watched.data(), nfds_t(n + 1), room_ms == 0 ? look_ms : std::min(look_ms, room_ms));
        if (asker_ >= 0) follow();
        log_refused_tares();
        for (std::size_t i = 0; i < n && !stop_.load(); ++i)
            if (watched[i].revents != 0) try {
                    take(std::move(silent_[i].client));
                } catch (const std::exception&) {}  // no memory: the client gets no answer
        std::erase_if(silent_, [](const Silent& one) { return one.client < 0; });
        if (watched[n].revents != 0 && !stop_.load()) accept();
    }
}

// Returns the time until a newcomer gets a place: 0 if there is one, or if the client that has been silent for longest has
// had kPatienceMs for its request. It keeps its place as long as no other client needs it.
int ControlSocket::room_in_ms() const noexcept {
    if (silent_.size() < kPlaces) return 0;
    const auto silent_ms = (monotonic_ns() - silent_.front().since_ns) / 1'000'000u;
    return silent_ms >= std::uint64_t(kPatienceMs) ? 0 : kPatienceMs - int(silent_ms);
}

void ControlSocket::accept() noexcept {
    Descriptor client(::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    const bool no_room = client < 0 || silent_.size() == kPlaces;
    if (no_room && !silent_.empty()) silent_.erase(silent_.begin());
    if (client >= 0)
        silent_.push_back({std::move(client), monotonic_ns()});
    else
        sleep_until(monotonic_ns() + std::uint64_t(kPatienceMs) * 1'000'000u);  // out of descriptors: avoids a busy loop
}

// Handles one client's request, which has arrived, or its end.
void ControlSocket::take(Descriptor client) {
    char request[128];
    const ssize_t size = ::recv(client, request, sizeof request, 0);
    if (has_hung_up(client)) return;  // the client has given up, for example because this process was stopped
    std::istringstream words(std::string(request, std::size_t(std::max<ssize_t>(size, 0))));
    std::string node, verb, mask, more;
    words >> node >> verb >> mask >> more;
    char* end = nullptr;
    const unsigned long value = std::strtoul(mask.c_str(), &end, 0);
    const bool mask_good = !mask.empty() && *end == 0 && more.empty() && value <= UINT32_MAX;
    Command command;
    command.mask = std::uint32_t(value);
    if (node == node_name_ && verb == "wake" && mask.empty()) {
        answer_with(client, writer_.wake_page());
    } else if (node == node_name_ && verb == "events" && mask.empty()) {
        const Descriptor event(events_.subscribe(client));
        answer_with(client, event);
    } else if (node == node_name_ && (verb == "tare" || verb == "untare") && mask_good) {
        command.kind = verb == "tare" ? Command::Kind::tare : Command::Kind::untare;
        begin(std::move(client), command);
    } else if (node == node_name_ && verb == "clear" && mask.empty()) {
        command.kind = Command::Kind::clear_latches;
        begin(std::move(client), command);
    } else if (node == node_name_ && verb == "weigh" && more.empty() && weigh_command(mask)) {
        begin(std::move(client), *weigh_command(mask));
    } else if (node == node_name_ && verb == "teach" && more.empty() && valid_name(mask)) {
        teach(std::move(client), mask);
    } else if (node == node_name_ && verb == "load-objects" && mask.empty()) {
        load_objects(std::move(client));
    } else if (node == node_name_ && verb == "objects-file" && mask.empty()) {
        answer(client, objects_path_.empty() ? "-" : objects_path_);
    } else if (node == node_name_ && verb == "config-file" && mask.empty()) {
        answer(client, config_path_.empty() ? "-" : config_path_);
    } else if (size > 0) {
        answer(client, TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_UNKNOWN);
    }
}

void ControlSocket::teach(Descriptor client, const std::string& name) {
    tactiled_node node{};
    if (objects_path_.empty()) return reject(client, TACTILED_COMMAND_NOT_NOW, "there is no [grasp] in the configuration");
    if (!segment_.latest_node(node) || node.grasp.weight_state != TACTILED_WEIGHT_STABLE)
        return reject(client, TACTILED_COMMAND_NOT_NOW, "no stable weight hangs on the jaws: grasp, lift and wait");
    try {
        teach_grasp(objects_path_, 0, name, weighing_of(node.grasp));
    } catch (const SetupError& error) { return reject(client, TACTILED_COMMAND_FAILED, error.what()); }
    load_objects(std::move(client));
}

void ControlSocket::load_objects(Descriptor client) {
    tactiled_node node{};
    const bool returned =
        segment_.latest_node(node) && std::int32_t(node.command[TACTILED_FROM_SOCKET].acknowledged - objects_number_) >= 0;
    const bool lent = objects_number_ != 0 && !returned;
    Problems problems;
    auto taught = tactiled::load_objects(objects_path_, problems);
    if (objects_path_.empty()) return reject(client, TACTILED_COMMAND_NOT_NOW, "there is no [grasp] in the configuration");
    if (!problems.empty()) return reject(client, TACTILED_COMMAND_FAILED, problems.lines().front());
    if (lent || asker_ >= 0) return reject(client, TACTILED_COMMAND_NOT_NOW, "another command runs");
    objects_ = std::move(taught);
    Command command;
    command.kind = Command::Kind::objects;
    command.objects = objects_;
    objects_number_ = number_ + 1;
    begin(std::move(client), command);
}

void ControlSocket::begin(Descriptor client, Command command) {
    command.number = number_ + 1;
    command.until_ns = monotonic_ns() + std::uint64_t(kAnswerMs) * 1'000'000u;
    if (asker_ >= 0 || !commands_.send(command))  // one at a time
        return answer(client, TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_NOT_NOW);
    ++number_;
    asker_ = std::move(client);
    give_up_ns_ = command.until_ns;
}

void ControlSocket::follow() {
    tactiled_node node{};
    const tactiled_command& command = node.command[TACTILED_FROM_SOCKET];
    if (segment_.latest_node(node) && command.acknowledged == number_ && command.state != TACTILED_COMMAND_RUNNING)
        answer(asker_, command.state, command.result);
    else if (monotonic_ns() > give_up_ns_)
        answer(asker_, TACTILED_COMMAND_DONE, TACTILED_COMMAND_TIMED_OUT);
    else
        return;
    asker_.reset();
}

// Logs refused tares for any commander, because a PLC that tares through one register sees only WARN. At most one
// line each 10 s.
void ControlSocket::log_refused_tares() {
    tactiled_node node{};
    if (!segment_.latest_node(node)) return;
    for (std::size_t commander = 0; commander < TACTILED_COMMANDERS; ++commander) {
        const tactiled_command& command = node.command[commander];
        const bool moving = command.result == TACTILED_COMMAND_MOVING;
        if (!moving && command.result != TACTILED_COMMAND_UNDER_LOAD) continue;
        if (command.acknowledged == std::exchange(refusal_seen_[commander], command.acknowledged)) continue;
        ++refused_tares_;
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns < silent_until_ns_) continue;
        silent_until_ns_ = now_ns + kLogEachNs;
        log_line(LogLevel::warning, "tare refused: {} ({} refused since the start)",
                 moving ? "the force moved while the zero was averaged; wait until it rests, or raise tare_ms"
                        : "a sensor is under load, beyond its tare_limit_N",
                 refused_tares_);
    }
}

}  // namespace tactiled
