// tactiled-rdt: a sensor as the UDP stream of an ATI Net F/T, so that clients of that device read it unchanged.
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/errqueue.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <optional>

#include "config/network_address.hpp"
#include "config/options.hpp"
#include "drivers/descriptor.hpp"
#include "node/bridges/bridge.hpp"
#include "node/bridges/edge.hpp"
#include "node/bridges/rdt_packet.hpp"
#include "node/ctl/command_line.hpp"
#include "node/modbus/allow_list.hpp"

namespace tactiled::bridges::rdt {
namespace {

constexpr std::size_t kMaxClients = 8;  // each stream serves so many
constexpr std::array<const char*, 6> kAxes{"fx", "fy", "fz", "mx", "my", "mz"};

struct Args {
    Common common;
    std::vector<std::string> listen{"127.0.0.1:49152"}, allow, zero;
    Scale scale;
    bool good_only = false, bias = false;
};

struct Client {
    sockaddr_storage address;
    std::uint32_t left;      // records to send; 0: until it stops
    std::uint32_t sequence;  // number of its next record
    Wrench bias;
    Pace pace;
    bool wants_bias;
};

bool is_same(const sockaddr_storage& a, const sockaddr_storage& b) {
    const auto port = [](const sockaddr_storage& s) { return reinterpret_cast<const sockaddr_in&>(s).sin_port; };
    return port(a) == port(b) && modbus::same_host(a, b);  // both families have the port in the same place
}

// One sensor on one port.
class Stream {
public:
    Stream(const Args& args, std::string sensor, const std::string& listen, std::uint32_t zero)
        : args_(args), sensor_(std::move(sensor)), zero_(zero), allow_(args.allow) {
        const ListenAddress address = check_listen_address(listen);
        fd_.reset(::socket(address.bytes.ss_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
        const int one = 1;
        // The kernel then reports which client has gone.
        ::setsockopt(fd_, IPPROTO_IP, IP_RECVERR, &one, sizeof one);
        if (address.bytes.ss_family == AF_INET6) ::setsockopt(fd_, IPPROTO_IPV6, IPV6_RECVERR, &one, sizeof one);
        if (fd_ < 0 || ::bind(fd_, reinterpret_cast<const sockaddr*>(&address.bytes), address.size) != 0)
            throw SetupError(fmt::format("--listen {}: {}", listen, std::strerror(errno)));
    }

    [[nodiscard]] int fd() const { return fd_; }
    [[nodiscard]] bool has_clients() const { return !clients_.empty(); }
    [[nodiscard]] const std::string& sensor() const { return sensor_; }

    // All requests that have come.
    void receive() {
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

    // Sends a sample to every client, unless it has no value.
    void send(const tactiled_sample& sample, Counts& counts) {
        if (args_.good_only && sample.quality != TACTILED_GOOD) return;
        const auto values = values_of(sample, zero_);
        if (!values) return;
        for (auto client = clients_.begin(); client != clients_.end();) {
            if (!send_to(*client, sample, *values, counts))
                client = clients_.erase(client);
            else
                ++client;
        }
    }

private:
    void obey(const Request& request, const sockaddr_storage& from) {
        const auto client =
            std::find_if(clients_.begin(), clients_.end(), [&](const Client& c) { return is_same(c.address, from); });
        switch (request.command) {
            case kStop:
                if (client != clients_.end()) clients_.erase(client);
                return;
            case kBias:
                if (client != clients_.end()) client->wants_bias = args_.bias;
                if (args_.bias && client == clients_.end()) bias_next_ = true;
                if (!args_.bias && !std::exchange(refused_bias_, true))
                    fmt::print(stderr,
                               "tactiled-rdt: a client asks for a bias, which is refused: tare the sensor with "
                               "tactilectl, or see --bias\n");
                return;
            case kStream:
            case kBuffered:
            case kMultiUnit: break;
            default: return;
        }
        Client fresh{from, request.count, 1, {}, Pace(args_.common.rate_Hz), std::exchange(bias_next_, false)};
        if (client != clients_.end()) {  // a new start keeps its zero, as the device does
            fresh.bias = client->bias;
            fresh.wants_bias |= client->wants_bias;
            *client = fresh;
        } else if (clients_.size() < kMaxClients) {
            clients_.push_back(fresh);
        }
    }

    // False: it has all that it asked for.
    bool send_to(Client& client, const tactiled_sample& sample, Wrench values, Counts& counts) {
        if (!client.pace.passes(sample)) return true;
        if (std::exchange(client.wants_bias, false)) client.bias = values;
        for (std::size_t i = 0; i < 6; ++i) values[i] -= client.bias[i];
        const auto record = encode(client.sequence, std::uint32_t(sample.sequence),
                                   rdt_status(sample.quality, sample.reasons), values, args_.scale);
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

    // Clients whose port is closed.
    void drop_gone() {
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

    const Args& args_;
    std::string sensor_;
    std::uint32_t zero_;
    modbus::AllowList allow_;
    Descriptor fd_;
    bool bias_next_ = false, refused_bias_ = false;
    std::vector<Client> clients_;
};

std::uint32_t zero_mask(const std::vector<std::string>& axes) {
    std::uint32_t mask = 0;
    for (const std::string& axis : axes) mask |= 1u << (std::find(kAxes.begin(), kAxes.end(), axis) - kAxes.begin());
    return mask;
}

std::string axes_text(std::uint32_t mask) {
    std::string text;
    for (std::size_t i = 0; i < kAxes.size(); ++i)
        if ((mask >> i & 1u) != 0) text += (text.empty() ? "" : ",") + std::string(kAxes[i]);
    return text;
}

// "" or why this sensor cannot be sent.
std::string fault_of(const Segment& segment, int sensor, const std::string& name, std::uint32_t zero) {
    if (sensor < 0) return fmt::format("the node has no sensor \"{}\"", name);
    const std::uint32_t sees = segment.sensor(std::uint32_t(sensor)).components & 63u, missing = 63u & ~sees;
    if (missing == zero) return "";
    if ((missing & ~zero) != 0)
        return fmt::format("sensor \"{}\" does not measure {}, and RDT has no way to say so; --zero {} sends 0 for them",
                           name, axes_text(missing & ~zero), axes_text(missing));
    return fmt::format("sensor \"{}\" measures {}, which --zero would hide", name, axes_text(zero & sees));
}

class Server {
public:
    explicit Server(const Args& args) : args_(args), zero_(zero_mask(args.zero)), follower_(args.common.node) {
        check_addresses();
        follower_.look();
        std::vector<std::string> names = args.common.sensors;
        if (names.empty()) {
            if (!follower_.segment().is_open() || follower_.n_sensors() != 1)
                throw SetupError(follower_.segment().is_open()
                                     ? "the node has several sensors: choose with --sensor"
                                     : fmt::format("--sensor is needed while no daemon runs ({})", follower_.why()));
            names = {follower_.segment().sensor(0).name};
        }
        if (names.size() != args.listen.size())
            throw SetupError(
                fmt::format("{} sensors, and {} addresses to listen on: each --sensor needs a --listen of its own",
                            names.size(), args.listen.size()));
        for (std::size_t i = 0; i < names.size(); ++i)
            streams_.push_back(std::make_unique<Stream>(args, names[i], args.listen[i], zero_));
        const std::string fault = bind_sensors();
        if (!fault.empty() && follower_.segment().is_open()) throw SetupError(fault);
    }

    int serve() {
        ctl::catch_interrupt();
        report_.ready(fmt::format("{} of node \"{}\" on {}", fmt::join(names(), ", "), args_.common.node,
                                  fmt::join(args_.listen, ", ")));
        std::vector<pollfd> ready;
        for (const auto& stream : streams_) ready.push_back({stream->fd(), POLLIN, 0});
        while (ctl::interrupted == 0) {
            bool wanted = false;
            for (const auto& stream : streams_) {
                stream->receive();
                wanted |= stream->has_clients();
            }
            follower_.look();
            if (structure_ != follower_.structure()) bind_sensors();
            send();
            report_.tick(follower_, counts_, fault_.empty() ? (wanted ? "streaming" : "no client") : fault_);
            if (wanted)
                follower_.wait(monotonic_ns() + 20'000'000);
            else
                ::poll(ready.data(), ready.size(), 20);
        }
        report_.ended(follower_, counts_);
        return ctl::kGood;
    }

private:
    void check_addresses() const {
        for (const std::string& text : args_.listen) {
            const ListenAddress checked = check_listen_address(text);
            if (!checked.fault.empty()) throw SetupError(fmt::format("--listen {}: {}", text, checked.fault));
            if (!checked.loopback && args_.allow.empty())
                throw SetupError(
                    fmt::format("--listen {}: name the clients with --allow, such as --allow 192.168.1.20/32", text));
        }
        for (const std::string& text : args_.allow)
            if (const std::string fault = fault_of_network(text); !fault.empty())
                throw SetupError(fmt::format("--allow {}: {}", text, fault));
    }

    std::vector<std::string> names() const {
        std::vector<std::string> out;
        for (const auto& stream : streams_) out.push_back(stream->sensor());
        return out;
    }

    // Finds the streams' sensors in the segment. A sensor that may not be sent has no index.
    std::string bind_sensors() {
        structure_ = follower_.structure();
        fault_.clear();
        index_.assign(streams_.size(), -1);
        if (!follower_.segment().is_open()) return follower_.why();
        for (std::size_t i = 0; i < streams_.size(); ++i) {
            const int index = follower_.segment().find(streams_[i]->sensor());
            const std::string fault = fault_of(follower_.segment(), index, streams_[i]->sensor(), zero_);
            if (fault.empty())
                index_[i] = index;
            else
                fault_ = fault;
        }
        return fault_;
    }

    void send() {
        for (std::size_t i = 0; i < streams_.size(); ++i) {
            tactiled_sample sample;
            while (index_[i] >= 0 && follower_.next(std::uint32_t(index_[i]), sample)) streams_[i]->send(sample, counts_);
        }
    }

    const Args& args_;
    std::uint32_t zero_;
    Follower follower_;
    std::uint64_t structure_ = 0;
    std::string fault_;
    std::vector<std::unique_ptr<Stream>> streams_;
    std::vector<int> index_;
    Counts counts_;
    Report report_{"tactiled-rdt"};
};

}  // namespace
}  // namespace tactiled::bridges::rdt

int main(int argc, char** argv) {
    using namespace tactiled;
    using namespace tactiled::bridges;
    ctl::Program app{
        "Sends forces of a tactiled daemon by UDP, as an ATI Net F/T does (RDT). A value that is BAD is not sent.",
        "tactiled-rdt"};
    rdt::Args args;
    add_common_options(app, args.common);
    app.add_option("--listen", args.listen, "ADDRESS:PORT of a sensor's stream; again for each further --sensor")
        .show_default();
    app.add_option("--allow", args.allow, "ADDRESS/BITS of clients; needed beyond the loopback");
    app.add_option("--zero", args.zero, "axes that the sensor does not measure and that are sent as 0, such as mx,my,mz")
        .delimiter(',')
        .one_of({"fx", "fy", "fz", "mx", "my", "mz"});
    app.add_flag("--good-only", args.good_only, "sends nothing while a value is uncertain, either");
    app.add_flag("--bias", args.bias, "lets a client set the zero of its own stream; the daemon's values stay as they are");
    app.add_option("--counts-per-N", args.scale.counts_per_N, "scale of the forces, as the client expects it")
        .number_in(1, 1e9)
        .show_default();
    app.add_option("--counts-per-Nm", args.scale.counts_per_Nm, "scale of the torques").number_in(1, 1e9).show_default();
    app.footer(
        "Examples:\n"
        "  tactiled-rdt --sensor wrist                            six axes, for clients on this machine\n"
        "  tactiled-rdt --sensor left --zero mx,my,mz             a sensor of three axes\n"
        "  tactiled-rdt --sensor left --listen 192.168.1.1:49152 --allow 192.168.1.20/32 --zero mx,my,mz\n"
        "  tactiled-rdt --sensor left --listen 127.0.0.1:49152 --sensor right --listen 127.0.0.2:49152 --zero mx,my,mz");
    return ctl::run_program(app, argc, argv, [&] { return rdt::Server(args).serve(); });
}
