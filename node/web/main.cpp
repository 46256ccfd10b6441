// tactiled-web: the page of a tactiled daemon, its metrics and its state as JSON, over HTTP. Reads the segment; with a token
// it also sends commands through the control socket.
#include <fmt/format.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <random>
#include <utility>

#include "config/network_address.hpp"
#include "config/text_file.hpp"
#include "node/ctl/command_line.hpp"
#include "node/web/messages.hpp"
#include "node/web/player.hpp"
#include "node/web/server.hpp"

namespace tactiled::web {
namespace {

struct Args {
    std::string node = "gripper", listen = "127.0.0.1:8080", token_file, recording;
    std::vector<std::string> host_names;
    unsigned streams = 16;
};

constexpr std::size_t kMinToken = 16;

std::string token_in(const std::string& path) {
    if (path.empty()) return "";
    Problems problems;
    const std::string text = read_text_file(path, 4096, problems).value_or("");
    problems.throw_if_any();
    const auto token = std::string_view(text).substr(0, text.find_last_not_of(" \t\r\n") + 1);
    const bool printable = std::all_of(token.begin(), token.end(), [](unsigned char c) { return c > ' ' && c < 127; });
    if (token.size() < kMinToken || !printable)
        throw SetupError(
            fmt::format("{}: a token is one line of at least {} printable characters, such as that of "
                        "\"openssl rand -hex 16\"",
                        path, kMinToken));
    return std::string(token);
}

int listen_on(const std::string& text) {
    const ListenAddress address = check_listen_address(text);
    if (!address.fault.empty()) throw SetupError(fmt::format("--listen {}: {}", text, address.fault));
    const int fd = ::socket(address.bytes.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int one = 1;
    ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (fd < 0 || ::bind(fd, reinterpret_cast<const sockaddr*>(&address.bytes), address.size) != 0 ||
        ::listen(fd, 1024) != 0)
        throw SetupError(fmt::format("--listen {}: {}", text, std::strerror(errno)));
    if (!address.loopback)
        fmt::print(stderr,
                   "tactiled-web: warning: {} can be reached from other machines, without encryption: forces and the "
                   "token can be read on the way (ssh -L, or a proxy with TLS, prevents that)\n",
                   text);
    return fd;
}

// Allows as many connections as the process may have files, and a few for itself.
unsigned max_connections() {
    constexpr rlim_t kWanted = 2048, kOwn = 64;
    rlimit files{};
    if (::getrlimit(RLIMIT_NOFILE, &files) != 0) files = {1024, 1024};
    files.rlim_cur = std::max(files.rlim_cur, std::min(files.rlim_max, kWanted));
    if (::setrlimit(RLIMIT_NOFILE, &files) != 0) files.rlim_cur = std::min<rlim_t>(files.rlim_cur, 1024);
    return unsigned(std::min(kWanted, files.rlim_cur) - std::min(files.rlim_cur / 2, kOwn));
}

// A random number that identifies one run of this server.
std::string run_number() {
    std::random_device random;
    return fmt::format("{:08x}{:08x}", random(), random());
}

class Site {
public:
    Site(const Args& args, int listener, const std::string& token)
        : source_(args.node),
          has_commands_(!token.empty()),
          node_(args.node),
          run_(run_number()),
          server_(listener, {args.host_names, token}, content(), {max_connections(), args.streams}) {}

    void tick() {
        const View& view = source_.tick();
        const bool changed = std::exchange(structure_, view.structure) != view.structure;
        if (changed) history_.name_sensors(sensor_names());
        history_.add(view);
        timeline_.observe(view);
        ++ticks_;
        server_.begin_tick();
        if (changed) server_.greet_again();
        if (ticks_ % 30 == 0) server_.sweep();
        if (server_.streams() == 0) return;
        server_.publish(std::make_shared<const std::string>(frame_message(view, ticks_ % 10 == 0)));
    }
    Server& server() { return server_; }

private:
    Content content() {
        return {[this] { return greeting(); },
                [this] { return timeline_.revision(); },
                [this](std::uint64_t revision, std::string& out) { append_changes(timeline_, revision, out); },
                [this] { return status_body(source_.view(), node_); },
                [this] { return events_body(timeline_); },
                [this] { return metrics_text(source_.view(), node_, server_.streams()); },
                [this] { return sensor_names(); },
                [this] {
                    const View& view = source_.view();
                    return std::string(view.is_alive ? view.segment->header().control : "");
                },
                [this] { return node_; },
                [this](const std::string& sensor) { return find_array(source_.view(), sensor); },
                [this](std::uint32_t sensor) { return array_body(source_.view(), sensor); },
                [this](std::uint32_t sensor) { return places_body(source_.view(), sensor); }};
    }
    std::vector<std::string> sensor_names() const {
        std::vector<std::string> names;
        const View& view = source_.view();
        for (std::uint32_t i = 0; i < view.n_sensors(); ++i) names.emplace_back(view.segment->sensor(i).name);
        return names;
    }
    std::string greeting() {
        const View& view = source_.view();
        std::string out = "retry: 500\n\n" + hello_message(view, run_, has_commands_);
        for (std::uint32_t i = 0; i < view.n_sensors(); ++i) append_past(view, history_, i, out);
        append_changes(timeline_, 0, out);
        return out + frame_message(view, true);
    }

    Source source_;
    History history_;
    Timeline timeline_;
    bool has_commands_;
    std::string node_, run_;
    std::uint64_t structure_ = 0, ticks_ = 0;
    Server server_;
};

int serve(Args args) {
    const std::string token = token_in(args.token_file);
    const int listener = listen_on(args.listen);
    ctl::catch_interrupt();
    std::optional<Player> player;
    if (!args.recording.empty()) {
        if (!token.empty()) throw SetupError("a recording takes no commands: leave --token-file out");
        player.emplace(args.recording);
        args.node = player->node_name();
    }
    Site site(args, listener, token);
    const int timer = ::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    const itimerspec each{{0, long(1e9 / kTicksPerS)}, {0, 1}};
    ::timerfd_settime(timer, 0, &each, nullptr);
    if (player) fmt::print(stderr, "tactiled-web: plays {}, again and again\n", args.recording);
    fmt::print(stderr, "tactiled-web: http://{}/ shows node \"{}\"; commands are {}\n", args.listen, args.node,
               token.empty() ? "off" : "on, with the token");
    std::vector<pollfd> ready{{timer, POLLIN, 0}};
    for (const int fd : site.server().descriptors()) ready.push_back({fd, POLLIN, 0});
    while (ctl::interrupted == 0) {
        ::poll(ready.data(), ready.size(), site.server().timeout_ms());
        std::uint64_t periods = 0;
        if (::read(timer, &periods, sizeof periods) == ssize_t(sizeof periods)) site.tick();
        site.server().run();
    }
    return ctl::kGood;
}

}  // namespace
}  // namespace tactiled::web

int main(int argc, char** argv) {
    using namespace tactiled;
    ctl::Program app{"Shows a tactiled daemon as a web page with live forces, as Prometheus metrics and as JSON.",
                     "tactiled-web"};
    app.version(TACTILED_VERSION);
    web::Args args;
    ctl::add_node_option(app, args.node);
    app.add_option("--listen", args.listen,
                   "ADDRESS:PORT or [IPv6]:PORT; a loopback address can be reached from this machine alone")
        .show_default();
    app.add_option("recording", args.recording, "FILE.mcap of tactilectl record: shows it instead of a daemon")
        .existing_file();
    app.add_option("--host-name", args.host_names, "name under which browsers may call, beside localhost and addresses");
    app.add_option("--token-file", args.token_file,
                   "accepts tare, clear, weigh and teach from clients with the token in this file");
    app.add_option("--max-pages", args.streams, "pages that may be open at once").integer_in(1, 64).show_default();
    app.footer(
        "Examples:\n"
        "  tactiled-web                        then open http://localhost:8080/\n"
        "  curl localhost:8080/metrics         for Prometheus; /api/status is JSON\n"
        "  curl 'localhost:8080/api/array?sensor=skin'   forces of the taxels; /api/places has their places\n"
        "  tactiled-web --token-file token     commands, after: openssl rand -hex 16 > token\n"
        "  tactiled-web pick.mcap              a recording, at its own pace\n"
        "  ssh -L 8080:localhost:8080 GRIPPER  the page of another machine, encrypted");
    return ctl::run_program(app, argc, argv, [&] { return web::serve(args); });
}
