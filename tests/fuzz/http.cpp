// Bytes of a client of the web page, in any pieces, to the server of tactiled-web over the loopback. Oracle: a request that
// the model below can read is let through if and only if the model lets it through; no command begins without the token
// and an Origin; every answer is HTTP; an ordinary client is served afterwards.
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cctype>
#include <map>
#include <optional>
#include <regex>
#include <string>

#include "node/web/assets.hpp"
#include "node/web/server.hpp"
#include "tests/fuzz/input.hpp"

namespace tactiled::web {

std::span<const Asset> assets() {
    static const Asset page[] = {{"/", "text/html", "page"}};
    return page;
}

}  // namespace tactiled::web

namespace {

using namespace tactiled::web;
using tactiled::fuzz::check;
using tactiled::fuzz::Input;

constexpr const char* kToken = "token-of-the-fuzzer-0";
int reads = 0, commands = 0;

struct Site {
    Site() : fd(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t size = sizeof address;
        check(::bind(fd, reinterpret_cast<const sockaddr*>(&address), size) == 0 && ::listen(fd, 64) == 0);
        check(::getsockname(fd, reinterpret_cast<sockaddr*>(&to), &size) == 0);
        const auto text = [](const char* what) {
            return [what] {
                ++reads;
                return std::string(what);
            };
        };
        server = std::make_unique<Server>(
            fd, Access{{"gripper.example"}, kToken},
            Content{text("data: hello\n\n"), [] { return std::uint64_t(0); }, [](std::uint64_t, std::string&) {},
                    text("status"), text("events"), text("metrics"),
                    [] {
                        ++commands;
                        return std::vector<std::string>{"left"};
                    },
                    [] { return std::string(); }, [] { return std::string("node"); },
                    [](const std::string& sensor) { return sensor == "left" ? 0 : -1; },
                    [](std::uint32_t) { return std::string("array"); },
                    [](std::uint32_t) { return std::string("places"); }});
    }
    int fd;
    sockaddr_in to{};
    std::unique_ptr<Server> server;
};

Site& site() {
    static auto* const made = new Site;
    return *made;
}

// Sends `bytes` in pieces; returns the answer as far as it comes.
std::string talk(const std::string& bytes, std::size_t piece) {
    Server& server = *site().server;
    const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
    check(::connect(fd, reinterpret_cast<const sockaddr*>(&site().to), sizeof site().to) == 0);
    ::fcntl(fd, F_SETFL, O_NONBLOCK);
    for (std::size_t at = 0; at < bytes.size(); at += piece) {
        if (::send(fd, bytes.data() + at, std::min(piece, bytes.size() - at), MSG_NOSIGNAL) < 0) break;
        server.run();
    }
    ::shutdown(fd, SHUT_WR);
    std::string answer;
    for (int idle = 0; idle < 3;) {
        server.begin_tick();
        server.publish(std::make_shared<const std::string>("data: {}\n\n"));
        server.run();
        char part[4096];
        const ssize_t n = ::recv(fd, part, sizeof part, 0);
        if (n > 0) answer.append(part, std::size_t(n));
        if (n == 0 || answer.size() > 100'000 || answer.find("data: {}") != answer.npos) break;
        if (n > 0) continue;
        ++idle;
        std::vector<pollfd> ready;
        for (const int each : server.descriptors()) ready.push_back({each, POLLIN, 0});
        ready.push_back({fd, POLLIN, 0});
        ::poll(ready.data(), ready.size(), 2);
    }
    ::close(fd);
    server.run();
    return answer;
}

std::string lower(std::string text) {
    for (char& c : text) c = char(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

struct Verdict {
    bool reads = false, commands = false;
};

// One plain request without a body, or with a body of the stated length; nullopt: the model does not judge it.
std::optional<Verdict> model(const std::string& bytes) {
    static const std::regex whole(
        "(GET|HEAD|POST) (/[a-z/]*) HTTP/1\\.1\r\n((?:[A-Za-z-]+: [!-~](?:[ -~]*[!-~])?\r\n)*)\r\n([\\s\\S]*)");
    static const std::regex line("([A-Za-z-]+): ([^\r]*)\r\n");
    static const std::regex host_and_port("(.*?)(?::[0-9]{1,5})?");
    std::smatch part;
    if (bytes.size() > 2000 || !std::regex_match(bytes, part, whole)) return std::nullopt;
    std::map<std::string, std::string> fields;
    const std::string lines = part[3], path = part[2], method = part[1];
    for (std::sregex_iterator each(lines.begin(), lines.end(), line), end; each != end; ++each)
        if (!fields.emplace(lower((*each)[1]), (*each)[2]).second) return std::nullopt;
    for (const char* hard : {"transfer-encoding", "expect", "connection", "upgrade", "content-encoding", "te", "trailer"})
        if (fields.count(hard) != 0) return std::nullopt;
    const std::size_t body = std::string(part[4]).size();
    if (fields.count("content-length") == 0 ? body != 0 : fields["content-length"] != std::to_string(body) || body > 4096)
        return std::nullopt;
    const std::string host = lower(fields["host"]), origin = lower(fields["origin"]), fetch = fields["sec-fetch-site"];
    std::smatch named;
    if (!std::regex_match(host, named, host_and_port)) return std::nullopt;
    std::string name = named[1];
    if (name.size() > 1 && name.back() == '.') name.pop_back();
    in6_addr unused;
    const bool is_six = name.size() > 2 && name.front() == '[' && name.back() == ']' &&
                        ::inet_pton(AF_INET6, name.substr(1, name.size() - 2).c_str(), &unused) == 1;
    const bool is_known =
        name == "localhost" || name == "gripper.example" || is_six || ::inet_pton(AF_INET, name.c_str(), &unused) == 1;
    const bool is_own = origin == "http://" + host || origin == "https://" + host;
    const bool is_foreign = (fetch == "cross-site" || fetch == "same-site") && fields["sec-fetch-mode"] != "navigate";
    const bool may_read = is_known && (origin.empty() || is_own) && !is_foreign;
    const std::string type = fields["content-type"];
    const bool may_command = may_read && is_own && (fetch.empty() || fetch == "same-origin") &&
                             fields["authorization"] == std::string("Bearer ") + kToken &&
                             lower(type.substr(0, type.find(';'))) == "application/json";
    Verdict verdict;
    const bool is_text = path == "/api/status" || path == "/api/events" || path == "/metrics";
    verdict.reads = may_read && ((method != "POST" && is_text) || (method == "GET" && path == "/api/stream"));
    verdict.commands = may_command && method == "POST" && path == "/api/command";
    return verdict;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(data, size);
    const std::size_t piece = 1 + input.byte() * 8u;
    const auto rest = input.take(input.left());
    const std::string bytes(rest.begin(), rest.end());
    reads = commands = 0;
    const std::string answer = talk(bytes, piece);
    check(answer.empty() || answer.rfind("HTTP/1.", 0) == 0);
    check(answer.find("Access-Control-Allow") == answer.npos);
    if (commands > 0) check(bytes.find(kToken) != bytes.npos && lower(bytes).find("origin") != bytes.npos);
    if (const auto verdict = model(bytes)) {
        check((reads > 0) == verdict->reads);
        check((commands > 0) == verdict->commands);
    }
    const std::string ordinary = talk("GET /api/status HTTP/1.1\r\nHost: localhost:8080\r\nConnection: close\r\n\r\n", 4096);
    check(ordinary.rfind("HTTP/1.1 200", 0) == 0 && ordinary.find("frame-ancestors 'none'") != ordinary.npos &&
          ordinary.substr(ordinary.size() - 6) == "status");
    check(site().server->streams() <= 16);
    return 0;
}
