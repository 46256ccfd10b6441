#include "node/bridges/rdt_stream.hpp"

#include <fmt/format.h>
#include <linux/errqueue.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "config/network_address.hpp"
#include "config/options.hpp"
#include "node/bridges/edge.hpp"

namespace tactiled::bridges::rdt {
namespace {

constexpr std::size_t kMaxClients = 8;
constexpr std::uint64_t kLogEachNs = 60'000'000'000;  // bounds the log: any client of the network can take places

bool is_same(const sockaddr_storage& a, const sockaddr_storage& b) {
    const auto port = [](const sockaddr_storage& s) { return reinterpret_cast<const sockaddr_in&>(s).sin_port; };
    return port(a) == port(b) && modbus::same_host(a, b);  // both families have the port in the same place
}

}  // namespace

Stream::Stream(const StreamOptions& options, std::string sensor, const std::string& listen, std::uint32_t zero)
    : options_(options), sensor_(std::move(sensor)), zero_(zero), allow_(options.allow) {
    const ListenAddress address = check_listen_address(listen);
    fd_.reset(::socket(address.bytes.ss_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    const int one = 1;
    // The kernel then reports which client has gone.
    ::setsockopt(fd_, IPPROTO_IP, IP_RECVERR, &one, sizeof one);
    if (address.bytes.ss_family == AF_INET6) ::setsockopt(fd_, IPPROTO_IPV6, IPV6_RECVERR, &one, sizeof one);
    if (fd_ < 0 || ::bind(fd_, reinterpret_cast<const sockaddr*>(&address.bytes), address.size) != 0)
        throw SetupError(fmt::format("--listen {}: {}", listen, std::strerror(errno)));
}

void Stream::receive() {
    drop_gone();
    std::array<std::uint8_t, 64> bytes;
    for (int n = 0; n < 64; ++n) {  // bounded: a flood of requests must not stop the stream
        sockaddr_storage from{};
        socklen_t size = sizeof from;
        const ssize_t got = ::recvfrom(fd_, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
        if (got < 0) return;
        const auto request = parse_request({bytes.data(), std::size_t(got)});
        if (request && allow_.allows(from)) obey(*request, from);
    }
}

void Stream::send(const tactiled_sample& sample, Counts& counts) {
    if (options_.good_only && !is_healthy(sample.quality)) return;
    const auto values = values_of(sample, zero_);
    if (!values) return;
    std::erase_if(clients_, [&](Client& client) { return !send_to(client, sample, *values, counts); });
}

void Stream::obey(const Request& request, const sockaddr_storage& from) {
    const auto client =
        std::find_if(clients_.begin(), clients_.end(), [&](const Client& c) { return is_same(c.address, from); });
    switch (request.command) {
        case kStop:
            if (client != clients_.end()) clients_.erase(client);
            return;
        case kBias:
            if (client != clients_.end()) client->wants_bias = options_.bias;
            if (options_.bias && client == clients_.end()) bias_next_ = true;
            if (!options_.bias && !std::exchange(refused_bias_, true))
                fmt::print(stderr,
                           "tactiled-rdt: a client asks for a bias, which is refused: tare the sensor with "
                           "tactilectl, or see --bias\n");
            return;
        case kStream:
        case kBuffered:
        case kMultiUnit: start(request, from); return;
        default: return;
    }
}

void Stream::start(const Request& request, const sockaddr_storage& from) {
    Client fresh{from, request.count, 1, {}, 0, Pace(options_.rate_Hz), std::exchange(bias_next_, false)};
    const auto client =
        std::find_if(clients_.begin(), clients_.end(), [&](const Client& c) { return is_same(c.address, from); });
    if (client != clients_.end()) {  // a new start keeps its zero, as the device does
        fresh.bias = client->bias;
        fresh.bias_tare = client->bias_tare;
        fresh.wants_bias |= client->wants_bias;
        clients_.erase(client);
    } else if (clients_.size() == kMaxClients) {
        make_place(from);
    }
    clients_.push_back(fresh);
}

// The host that would have the most places with `from` loses one, so that a host can take none from others that have fewer.
// The client of that host with the oldest request loses its place, because RDT has no other sign of life.
void Stream::make_place(const sockaddr_storage& from) {
    const auto places_of = [&](const Client& client) {
        const auto is_of_host = [&](const Client& c) { return modbus::same_host(c.address, client.address); };
        return std::count_if(clients_.begin(), clients_.end(), is_of_host) +
               (modbus::same_host(from, client.address) ? 1 : 0);
    };
    clients_.erase(std::max_element(clients_.begin(), clients_.end(),
                                    [&](const Client& a, const Client& b) { return places_of(a) < places_of(b); }));
    ++lost_places_;
    const std::uint64_t now_ns = monotonic_ns();
    if (logged_ns_ != 0 && now_ns - logged_ns_ < kLogEachNs) return;
    logged_ns_ = now_ns;
    fmt::print(stderr, "tactiled-rdt: \"{}\" has {} clients: {} of them lost its place to another one so far\n", sensor_,
               kMaxClients, lost_places_);
}

// Returns false if the client has all the records that it asked for.
bool Stream::send_to(Client& client, const tactiled_sample& sample, Wrench values, Counts& counts) {
    if (!client.pace.passes(sample)) return true;
    if (client.wants_bias && sample.quality == TACTILED_GOOD) {  // the bias of a doubtful value would outlive its doubt
        client.wants_bias = false;
        client.bias = values;
        client.bias_tare = sample.tare_count;
    }
    if (client.bias_tare != sample.tare_count) client.bias = {};
    for (std::size_t i = 0; i < 6; ++i) values[i] -= client.bias[i];
    const auto record = encode(client.sequence, std::uint32_t(sample.sequence), rdt_status(sample.quality, sample.reasons),
                               values, options_.scale);
    if (!record) {
        ++counts.dropped;
        return true;
    }
    const auto* const to = reinterpret_cast<const sockaddr*>(&client.address);
    const socklen_t size = client.address.ss_family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6);
    ++client.sequence;  // also where it fails: the client sees the gap
    const bool sent = ::sendto(fd_, record->data(), record->size(), MSG_NOSIGNAL, to, size) == ssize_t(record->size());
    ++(sent ? counts.sent : counts.dropped);
    return client.left == 0 || --client.left > 0;
}

// Removes the clients whose port is closed.
void Stream::drop_gone() {
    for (;;) {
        std::array<std::uint8_t, kRecordSize> bytes;
        alignas(cmsghdr) std::array<char, 512> control;
        sockaddr_storage to{};
        iovec part{bytes.data(), bytes.size()};
        msghdr message{};
        message.msg_name = &to;
        message.msg_namelen = sizeof to;
        message.msg_iov = &part;
        message.msg_iovlen = 1;
        message.msg_control = control.data();
        message.msg_controllen = control.size();
        if (::recvmsg(fd_, &message, MSG_ERRQUEUE) < 0) return;
        std::erase_if(clients_, [&](const Client& c) { return is_same(c.address, to); });
    }
}

}  // namespace tactiled::bridges::rdt
