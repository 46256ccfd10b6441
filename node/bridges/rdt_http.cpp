#include "node/bridges/rdt_http.hpp"

#include <fmt/format.h>
#include <microhttpd.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>

#include "config/network_address.hpp"
#include "config/options.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::bridges::rdt {
namespace {

// A client that sends nothing loses its place. 2 s: TCP sends a lost packet again after 1 s (RFC 6298).
constexpr unsigned kMaxConnections = 8, kSilentS = 2;
// A client that sends byte by byte loses it, too. A request and its answer are a packet each, either of which may be sent
// again.
constexpr std::uint64_t kLongestNs = 2 * kSilentS * 1'000'000'000ull;

MHD_Result is_allowed(void* list, const sockaddr* address, socklen_t size) {
    sockaddr_storage peer{};
    std::memcpy(&peer, address, std::min<std::size_t>(size, sizeof peer));
    return static_cast<const modbus::AllowList*>(list)->allows(peer) ? MHD_YES : MHD_NO;
}

MHD_Result respond(MHD_Connection* connection, unsigned status, const char* type, std::string text) {
    MHD_Response* const response = MHD_create_response_from_buffer(text.size(), text.data(), MHD_RESPMEM_MUST_COPY);
    MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type);
    MHD_add_response_header(response, MHD_HTTP_HEADER_CACHE_CONTROL, "no-store");
    MHD_add_response_header(response, MHD_HTTP_HEADER_CONNECTION, "close");
    const MHD_Result result = MHD_queue_response(connection, status, response);
    MHD_destroy_response(response);
    return result;
}

// False: a page of a browser that reached this address by a name of its own (DNS rebinding).
bool is_address(const char* host) {
    if (host == nullptr) return true;
    std::string text = host;
    if (text.find(':') == text.npos || text.back() == ']') text += ":80";
    return text.rfind("localhost:", 0) == 0 || check_listen_address(text).fault.empty();
}

// The device has one configuration, which a client may name.
bool is_configuration(MHD_Connection* connection) {
    const char* const index = MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, "index");
    return index == nullptr || std::strcmp(index, "0") == 0;
}

MHD_Result on_request(void* xml, MHD_Connection* connection, const char* path, const char* method, const char*, const char*,
                      std::size_t* size, void**) {
    if (*size != 0) return MHD_NO;  // no request has a body
    if (std::strcmp(method, MHD_HTTP_METHOD_GET) != 0 && std::strcmp(method, MHD_HTTP_METHOD_HEAD) != 0)
        return respond(connection, MHD_HTTP_METHOD_NOT_ALLOWED, "text/plain", "GET or HEAD\n");
    if (!is_address(MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_HOST)))
        return respond(connection, MHD_HTTP_FORBIDDEN, "text/plain", "ask by address or as localhost\n");
    if (std::strcmp(path, "/netftapi2.xml") != 0)
        return respond(connection, MHD_HTTP_NOT_FOUND, "text/plain", "the only page is /netftapi2.xml\n");
    if (!is_configuration(connection))
        return respond(connection, MHD_HTTP_NOT_FOUND, "text/plain", "the only configuration has the index 0\n");
    return respond(connection, MHD_HTTP_OK, "text/xml", (*static_cast<const std::function<std::string()>*>(xml))());
}

}  // namespace

Page::Page(const std::string& listen, const std::vector<std::string>& allow, std::function<std::string()> xml)
    : allow_(allow), xml_(std::move(xml)) {
    const ListenAddress address = check_listen_address(listen);
    const unsigned flags = MHD_USE_EPOLL | (address.bytes.ss_family == AF_INET6 ? unsigned(MHD_USE_IPv6) : 0u);
    errno = 0;
    daemon_ = MHD_start_daemon(flags, 0, &is_allowed, &allow_, &on_request, &xml_, MHD_OPTION_SOCK_ADDR,
                               reinterpret_cast<const sockaddr*>(&address.bytes), MHD_OPTION_CONNECTION_LIMIT,
                               kMaxConnections, MHD_OPTION_CONNECTION_TIMEOUT, kSilentS, MHD_OPTION_NOTIFY_CONNECTION,
                               &Page::on_connection, this, MHD_OPTION_END);
    if (daemon_ == nullptr)
        throw SetupError(fmt::format("--http-port: {}: {}{}", listen, std::strerror(errno),
                                     errno == EADDRINUSE ? "; several sensors need addresses of their own" : ""));
}

Page::~Page() { MHD_stop_daemon(daemon_); }

void Page::on_connection(void* self, MHD_Connection* connection, void**, MHD_ConnectionNotificationCode code) {
    auto& opened = static_cast<Page*>(self)->opened_;
    const int fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
    if (code == MHD_CONNECTION_NOTIFY_STARTED)
        opened.emplace_back(fd, monotonic_ns());
    else
        std::erase_if(opened, [&](const auto& each) { return each.first == fd; });
}

void Page::answer() {
    const std::uint64_t now_ns = monotonic_ns();
    for (const auto& [fd, opened_ns] : opened_)  // the library closes a connection that has ended
        if (now_ns - opened_ns > kLongestNs) ::shutdown(fd, SHUT_RDWR);
    MHD_run(daemon_);
}

}  // namespace tactiled::bridges::rdt
