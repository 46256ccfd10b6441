#include "node/web/server.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <strings.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "config/options.hpp"
#include "node/web/assets.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::web {
namespace {

constexpr const char* kJson = "application/json; charset=utf-8";
constexpr std::size_t kMaxBody = 4096;
constexpr std::size_t kConnectionMemory = 16 * 1024;  // request line and header fields
constexpr int kSendBuffer = 128 * 1024;               // buffer of the kernel: the limit of unread data for a slow page
constexpr std::uint64_t kAnswerNs = 30'000'000'000;   // longer than the longest command
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

std::string_view field(MHD_Connection* connection, const char* name) {
    const char* const value = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
    return value != nullptr ? value : std::string_view();
}

// Two fields Host are as good as none: which one counts would be a matter of opinion.
std::string_view host_field(MHD_Connection* connection) {
    int hosts = 0;
    const auto count = [](void* of, MHD_ValueKind, const char* name, const char*) {
        if (::strcasecmp(name, "Host") == 0) ++*static_cast<int*>(of);
        return MHD_YES;
    };
    MHD_get_connection_values(connection, MHD_HEADER_KIND, count, &hosts);
    return hosts == 1 ? field(connection, "Host") : std::string_view();
}

Fields fields_of(MHD_Connection* connection) {
    return {host_field(connection),
            field(connection, "Origin"),
            field(connection, "Sec-Fetch-Site"),
            field(connection, "Sec-Fetch-Mode"),
            field(connection, "Authorization"),
            field(connection, "Content-Type")};
}

using Response = std::unique_ptr<MHD_Response, decltype(&MHD_destroy_response)>;

void add_headers(MHD_Response* response, const char* type) {
    for (const auto& [name, value] : {std::pair{"Content-Type", type},
                                      {"Content-Security-Policy", kPolicy},
                                      {"X-Content-Type-Options", "nosniff"},
                                      {"X-Frame-Options", "DENY"},
                                      {"Referrer-Policy", "no-referrer"},
                                      {"Cross-Origin-Resource-Policy", "same-origin"},
                                      {"Cross-Origin-Opener-Policy", "same-origin"},
                                      {"Cache-Control", "no-store"}})
        MHD_add_response_header(response, name, value);
}

MHD_Result send(MHD_Connection* connection, unsigned status, std::string_view body, const char* type, bool copy = true,
                const char* extra = nullptr, const char* value = nullptr) {
    const Response response(MHD_create_response_from_buffer(body.size(), const_cast<char*>(body.data()),
                                                            copy ? MHD_RESPMEM_MUST_COPY : MHD_RESPMEM_PERSISTENT),
                            &MHD_destroy_response);
    if (!response) return MHD_NO;
    add_headers(response.get(), type);
    if (extra != nullptr) MHD_add_response_header(response.get(), extra, value);
    return MHD_queue_response(connection, status, response.get());
}

MHD_Result refuse(MHD_Connection* connection, unsigned status, const std::string& why, const char* extra = nullptr,
                  const char* value = nullptr) {
    const std::string body =
        nlohmann::json{{"schema", 1}, {"error", why}}.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    return send(connection, status, body + "\n", kJson, true, extra, value);
}

}  // namespace

struct Server::Connection {
    int fd = -1;
    std::uint64_t since_ns = 0;  // begin of the incomplete request
    bool is_busy = false;        // the request is complete and being answered
    bool is_stream = false;
    bool waits = false;  // for the daemon's answer to a command
};

struct Server::Stream {
    Server* server = nullptr;
    MHD_Connection* connection = nullptr;
    std::shared_ptr<const std::string> piece;
    std::size_t sent = 0;
    std::uint64_t frame_number = 0, revision = 0;
    bool is_greeted = false, is_suspended = false;
};

struct Server::Exchange {
    MHD_Connection* connection = nullptr;
    std::string body;
    bool too_long = false, waits = false, has_answer = false;
    Command command;
};

Server::Server(int listener, Access access, Content content, const Limits& limits)
    : access_(std::move(access)),
      content_(std::move(content)),
      limits_(limits),
      done_{::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)},
      commander_(done_.fd) {
    daemon_ = MHD_start_daemon(MHD_USE_EPOLL | MHD_ALLOW_SUSPEND_RESUME, 0, nullptr, nullptr, &Server::on_request, this,
                               MHD_OPTION_LISTEN_SOCKET, listener, MHD_OPTION_CONNECTION_LIMIT, limits.connections,
                               MHD_OPTION_CONNECTION_TIMEOUT, limits.silent_s, MHD_OPTION_CONNECTION_MEMORY_LIMIT,
                               kConnectionMemory, MHD_OPTION_NOTIFY_COMPLETED, &Server::on_completed, this,
                               MHD_OPTION_NOTIFY_CONNECTION, &Server::on_connection, this, MHD_OPTION_END);
    if (daemon_ == nullptr) throw SetupError("the HTTP server cannot be started: too few files may be open?");
}

Server::~Server() {
    closing_ = true;
    for (auto& [number, exchange] : waiting_) {
        exchange->command.why = "the server ends";
        exchange->has_answer = true;
        MHD_resume_connection(exchange->connection);
    }
    waiting_.clear();
    publish(frame_);
    for (int i = 0; i < 3; ++i) MHD_run(daemon_);
    made_.clear();
    MHD_stop_daemon(daemon_);
}

Server::EventFd::~EventFd() { ::close(fd); }

std::vector<int> Server::descriptors() const {
    return {MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_EPOLL_FD)->epoll_fd, done_.fd};
}

int Server::timeout_ms() const {
    MHD_UNSIGNED_LONG_LONG ms = 0;
    return MHD_get_timeout(daemon_, &ms) == MHD_YES ? int(std::min<MHD_UNSIGNED_LONG_LONG>(ms, 1000)) : -1;
}

void Server::run() {
    std::uint64_t count = 0;
    [[maybe_unused]] const auto got = ::read(done_.fd, &count, sizeof count);
    for (Command& done : commander_.take_done()) {
        const auto found = waiting_.find(done.id);
        if (found == waiting_.end()) continue;
        Exchange* const exchange = found->second;
        waiting_.erase(found);
        exchange->command = std::move(done);
        exchange->has_answer = true;
        MHD_resume_connection(exchange->connection);
    }
    MHD_run(daemon_);
    make_room();
}

void Server::publish(std::shared_ptr<const std::string> frame) {
    greeting_.reset();
    frame_ = std::move(frame);
    ++frame_number_;
    for (Stream& stream : streams_)
        if (std::exchange(stream.is_suspended, false)) MHD_resume_connection(stream.connection);
}

void Server::greet_again() {
    for (Stream& stream : streams_) stream.is_greeted = false;
}

void Server::sweep() {
    const std::uint64_t now_ns = monotonic_ns();
    for (const auto& [fd, connection] : connections_) {
        if (connection->is_stream) continue;  // the library closes it where it takes nothing
        const std::uint64_t allowed_ns = connection->is_busy ? kAnswerNs : limits_.request_s * 1'000'000'000ull;
        if (now_ns - connection->since_ns > allowed_ns) ::shutdown(fd, SHUT_RDWR);
    }
}

// A new client always finds a place. A client whose request is complete is served in the same run, so that it loses its
// connection only if a quarter of all connections are newer.
void Server::make_room() {
    if (connections_.size() <= limits_.connections / 4 * 3) return;
    std::vector<Connection*> open;
    for (const auto& [fd, connection] : connections_)
        if (!connection->is_stream && !connection->waits) open.push_back(connection);
    const std::size_t surplus = std::min(open.size(), connections_.size() - limits_.connections / 2);
    std::nth_element(open.begin(), open.begin() + std::ptrdiff_t(surplus), open.end(),
                     [](const Connection* a, const Connection* b) { return a->since_ns < b->since_ns; });
    for (std::size_t i = 0; i < surplus; ++i) ::shutdown(open[i]->fd, SHUT_RDWR);
    MHD_run(daemon_);
}

void Server::on_connection(void* self, MHD_Connection* connection, void** of_socket, MHD_ConnectionNotificationCode code) {
    Server& server = *static_cast<Server*>(self);
    if (code == MHD_CONNECTION_NOTIFY_STARTED) {
        const auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
        auto* const is = new Connection{info->connect_fd, monotonic_ns()};
        *of_socket = is;
        server.connections_[is->fd] = is;
        ::setsockopt(is->fd, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof kSendBuffer);
        const int silent_ms = int(server.limits_.silent_s) * 1000;
        ::setsockopt(is->fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &silent_ms, sizeof silent_ms);
    } else {
        auto* const is = static_cast<Connection*>(*of_socket);
        server.connections_.erase(is->fd);
        delete is;
    }
}

MHD_Result Server::on_request(void* self, MHD_Connection* connection, const char* url, const char* method, const char*,
                              const char* data, std::size_t* size, void** exchange) {
    Server& server = *static_cast<Server*>(self);
    if (*exchange == nullptr) {  // the header is complete; the body is not
        auto* const is = new Exchange;
        is->connection = connection;
        *exchange = is;
        std::size_t length = 0;
        const std::string_view text = field(connection, "Content-Length");
        const auto parsed = std::from_chars(text.data(), text.data() + text.size(), length);
        if (parsed.ec == std::errc() && length > kMaxBody) {
            is->too_long = true;
            return refuse(connection, 413, fmt::format("a body has at most {} bytes", kMaxBody));
        }
        return MHD_YES;
    }
    Exchange& is = *static_cast<Exchange*>(*exchange);
    if (*size != 0) {
        is.too_long = is.too_long || is.body.size() + *size > kMaxBody;
        if (!is.too_long) is.body.append(data, *size);
        *size = 0;
        return MHD_YES;
    }
    const auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    if (info != nullptr) static_cast<Connection*>(info->socket_context)->is_busy = true;
    try {
        return server.answer(connection, url, method, is);
    } catch (const std::exception&) { return MHD_NO; }  // no memory: the connection is closed
}

void Server::on_completed(void* self, MHD_Connection* connection, void** exchange, MHD_RequestTerminationCode) {
    auto* const is = static_cast<Exchange*>(*exchange);
    if (is != nullptr && is->waits) static_cast<Server*>(self)->waiting_.erase(is->command.id);
    delete is;
    *exchange = nullptr;
    const auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    if (info == nullptr || info->socket_context == nullptr) return;
    auto* const of = static_cast<Connection*>(info->socket_context);
    of->is_busy = of->waits = false;
    of->since_ns = monotonic_ns();
}

MHD_Result Server::answer(MHD_Connection* connection, const std::string& path, const std::string& method,
                          Exchange& exchange) {
    if (exchange.too_long) return refuse(connection, 413, fmt::format("a body has at most {} bytes", kMaxBody));
    if (exchange.has_answer) return answer_command(connection, exchange);
    const Refusal refusal = judge_read(access_, fields_of(connection));
    if (refusal.status != 0) return refuse(connection, unsigned(refusal.status), refusal.why);
    const bool is_command = path == "/api/command";
    if (is_command && method == "POST") return command(connection, exchange);
    if (is_command) return refuse(connection, 405, "commands are sent with POST", "Allow", "POST");
    if (method != "GET" && method != "HEAD")
        return refuse(connection, 405, "only GET and HEAD are known here", "Allow", "GET, HEAD");
    if (path == "/api/status") return send_made(connection, path, content_.status, kJson);
    if (path == "/api/events") return send_made(connection, path, content_.events, kJson);
    if (path == "/metrics") return send_made(connection, path, content_.metrics, "text/plain; version=0.0.4; charset=utf-8");
    if (path == "/api/array") return send_array(connection, path, content_.array);
    if (path == "/api/places") return send_array(connection, path, content_.places);
    if (path == "/api/stream" && method == "GET") return open_stream(connection);
    for (const Asset& asset : assets())
        if (asset.path == path) return send(connection, 200, asset.content, asset.type.data(), false);
    return refuse(connection, 404,
                  "known are /, /metrics, /api/status, /api/events, /api/array, /api/places, /api/schema and /api/command");
}

MHD_Result Server::send_array(MHD_Connection* connection, const std::string& path,
                              const std::function<std::string(std::uint32_t sensor)>& make) {
    const char* const sensor = MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, "sensor");
    if (sensor == nullptr) return refuse(connection, 400, "the request names no sensor: " + path + "?sensor=NAME");
    const int index = content_.find_array(sensor);
    if (index < 0) return refuse(connection, 404, fmt::format("there is no sensor \"{}\" with taxels", sensor));
    return send_made(
        connection, fmt::format("{} {}", path, index), [&] { return make(std::uint32_t(index)); }, kJson);
}

// A thousand requests within a tick cost one body.
MHD_Result Server::send_made(MHD_Connection* connection, const std::string& path, const std::function<std::string()>& make,
                             const char* type) {
    Made& made = made_[path];
    if (std::exchange(made.tick, tick_) != tick_ || made.response == nullptr) {
        const std::string body = make();
        made.response.reset(
            MHD_create_response_from_buffer(body.size(), const_cast<char*>(body.data()), MHD_RESPMEM_MUST_COPY),
            &MHD_destroy_response);
        if (made.response == nullptr) return MHD_NO;
        add_headers(made.response.get(), type);
    }
    return MHD_queue_response(connection, 200, made.response.get());
}

std::size_t Server::count_open_streams() const {
    std::size_t n = 0;
    for (const Stream& stream : streams_) {
        pollfd peer{MHD_get_connection_info(stream.connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd, POLLRDHUP, 0};
        if (::poll(&peer, 1, 0) == 1)
            ::shutdown(peer.fd, SHUT_RDWR);  // one that only stopped sending keeps no place either
        else
            ++n;
    }
    return n;
}

MHD_Result Server::open_stream(MHD_Connection* connection) {
    if (streams_.size() >= limits_.streams && count_open_streams() >= limits_.streams)
        return refuse(connection, 503, fmt::format("{} pages are open already", limits_.streams), "Retry-After", "5");
    streams_.emplace_front();
    streams_.front().server = this;
    streams_.front().connection = connection;
    Stream* const stream = &streams_.front();
    MHD_Response* const response =
        MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 32 * 1024, &Server::read_stream, stream, &Server::end_stream);
    if (response == nullptr) {
        streams_.pop_front();
        return MHD_NO;
    }
    const auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    static_cast<Connection*>(info->socket_context)->is_stream = true;
    add_headers(response, "text/event-stream; charset=utf-8");
    MHD_add_response_header(response, "X-Accel-Buffering", "no");  // a proxy must not keep values back
    const MHD_Result queued = MHD_queue_response(connection, 200, response);
    MHD_destroy_response(response);
    return queued;
}

ssize_t Server::read_stream(void* of, std::uint64_t, char* to, std::size_t size) {
    Stream& stream = *static_cast<Stream*>(of);
    Server& server = *stream.server;
    if (server.closing_) return MHD_CONTENT_READER_END_OF_STREAM;
    if (stream.piece == nullptr || stream.sent == stream.piece->size()) {
        stream.sent = 0;
        if (!std::exchange(stream.is_greeted, true)) {
            if (std::exchange(server.greeting_tick_, server.tick_) != server.tick_ || server.greeting_ == nullptr)
                server.greeting_ = std::make_shared<const std::string>(server.content_.greeting());
            stream.piece = server.greeting_;
            stream.revision = server.content_.revision();
            stream.frame_number = server.frame_number_;
        } else if (server.frame_ != nullptr && stream.frame_number != server.frame_number_) {
            stream.piece = server.frame_;
            stream.frame_number = server.frame_number_;
            if (const std::uint64_t newest = server.content_.revision(); stream.revision != newest) {
                std::string both = *server.frame_;
                server.content_.changes(std::exchange(stream.revision, newest), both);
                stream.piece = std::make_shared<const std::string>(std::move(both));
            }
        } else {
            stream.piece = nullptr;
            stream.is_suspended = true;
            MHD_suspend_connection(stream.connection);
            return 0;
        }
    }
    const std::size_t n = std::min(size, stream.piece->size() - stream.sent);
    std::memcpy(to, stream.piece->data() + stream.sent, n);
    stream.sent += n;
    return ssize_t(n);
}

void Server::end_stream(void* of) {
    const auto* const stream = static_cast<Stream*>(of);
    stream->server->streams_.remove_if([&](const Stream& each) { return &each == stream; });
}

MHD_Result Server::command(MHD_Connection* connection, Exchange& exchange) {
    const Refusal refusal = judge_change(access_, fields_of(connection));
    if (refusal.status != 0)
        return refusal.status == 401 ? refuse(connection, 401, refusal.why, "WWW-Authenticate", "Bearer")
                                     : refuse(connection, unsigned(refusal.status), refusal.why);
    const Order order = order_of(exchange.body, content_.sensors());
    if (!order.fault.empty()) return refuse(connection, 400, order.fault);
    exchange.command.id = next_command_++;
    exchange.command.socket = content_.control();
    exchange.command.request = content_.node() + " " + order.words;
    if (!commander_.begin(exchange.command))
        return refuse(connection, 503, "other commands are waiting", "Retry-After", "1");
    exchange.waits = true;
    waiting_[exchange.command.id] = &exchange;
    const auto* info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    static_cast<Connection*>(info->socket_context)->waits = true;
    MHD_suspend_connection(connection);
    return MHD_YES;
}

MHD_Result Server::answer_command(MHD_Connection* connection, const Exchange& exchange) {
    const Command& done = exchange.command;
    int state = 0, result = 0, used = 0;
    if (std::sscanf(done.answer.c_str(), "%d %d%n", &state, &result, &used) != 2)
        return refuse(connection, 504, done.why.empty() ? "unreadable answer of the daemon" : done.why);
    const std::string why = done.answer.substr(std::min(done.answer.size(), std::size_t(used) + 1));
    const nlohmann::json body{{"schema", 1}, {"request", done.request}, {"state", state}, {"result", result}, {"why", why}};
    return send(connection, result == TACTILED_COMMAND_OK ? 200 : 409,
                body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n", kJson);
}

}  // namespace tactiled::web
