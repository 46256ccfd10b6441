// tactiled-rdt: a sensor as the UDP stream of an ATI Net F/T, so that clients of that device read it unchanged.
#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <memory>

#include "config/network_address.hpp"
#include "config/options.hpp"
#include "node/bridges/bridge.hpp"
#include "node/bridges/rdt_http.hpp"
#include "node/bridges/rdt_page.hpp"
#include "node/bridges/rdt_stream.hpp"
#include "node/ctl/command_line.hpp"

namespace tactiled::bridges::rdt {
namespace {

constexpr std::array<const char*, 6> kAxes{"fx", "fy", "fz", "mx", "my", "mz"};

struct Args {
    Common common;
    std::vector<std::string> listen{"127.0.0.1:49152"}, zero;
    StreamOptions stream;
    int http_port = 0;  // 0: no page
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
            streams_.push_back(std::make_unique<Stream>(args.stream, names[i], args.listen[i], zero_));
        for (std::size_t i = 0; i < names.size() && args.http_port != 0; ++i) {
            const std::string address =
                args.listen[i].substr(0, args.listen[i].rfind(':') + 1) + std::to_string(args.http_port);
            pages_.push_back(std::make_unique<Page>(address, args.stream.allow, [this, i] { return xml_of(i); }));
        }
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
            answer();
            report_.tick(follower_, counts_, state(wanted));
            if (wanted)
                follower_.wait(monotonic_ns() + 20'000'000);
            else
                ::poll(ready.data(), ready.size(), 20);
        }
        report_.ended(follower_, counts_);
        return ctl::kGood;
    }

private:
    // For a person: a record cannot say that no device measures its values.
    [[nodiscard]] std::string state(bool wanted) const {
        if (!fault_.empty()) return fault_;
        return std::string(wanted ? "streaming" : "no client") + (follower_.is_simulated() ? ", simulated" : "");
    }

    void check_addresses() const {
        for (const std::string& text : args_.listen) {
            const ListenAddress checked = check_listen_address(text);
            if (!checked.fault.empty()) throw SetupError(fmt::format("--listen {}: {}", text, checked.fault));
            if (!checked.loopback && args_.stream.allow.empty())
                throw SetupError(
                    fmt::format("--listen {}: name the clients with --allow, such as --allow 192.168.1.20/32", text));
        }
        for (const std::string& text : args_.stream.allow)
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

    // Requests for the pages: people and set-ups wait for them, so 50 times a second is enough.
    void answer() {
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns - answered_ns_ < 20'000'000) return;
        answered_ns_ = now_ns;
        for (const auto& page : pages_) page->answer();
    }

    [[nodiscard]] std::string xml_of(std::size_t stream) const {
        Device device;
        device.node = args_.common.node;
        device.sensor = streams_[stream]->sensor();
        device.address = args_.listen[stream].substr(0, args_.listen[stream].rfind(':'));
        device.scale = args_.stream.scale;
        device.zero = zero_;
        device.rate_Hz = args_.common.rate_Hz;
        device.simulated = follower_.is_simulated();
        device.calibration = follower_.segment().is_open() ? follower_.segment().header().calibration_id : 0;
        if (index_[stream] < 0) {  // no daemon, or a sensor that may not be sent
            tactiled_invalidate(&device.newest, TACTILED_DAEMON_STOPPED);
            return netft_xml(device);
        }
        const tactiled_sensor& sensor = follower_.segment().sensor(std::uint32_t(index_[stream]));
        device.serial = sensor.serial;
        std::copy(std::begin(sensor.full_scale), std::end(sensor.full_scale), device.full_scale.begin());
        follower_.segment().latest(std::uint32_t(index_[stream]), device.newest);
        return netft_xml(device);
    }

    const Args& args_;
    std::uint32_t zero_;
    Follower follower_;
    std::uint64_t structure_ = 0;
    std::string fault_;
    std::vector<std::unique_ptr<Stream>> streams_;
    std::vector<std::unique_ptr<Page>> pages_;
    std::uint64_t answered_ns_ = 0;
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
        "Sends forces of a tactiled daemon by UDP, as an ATI Net F/T does (RDT). A value that is UNCERTAIN has the error "
        "bit, one "
        "that is BAD is not sent.",
        "tactiled-rdt"};
    rdt::Args args;
    add_common_options(app, args.common);
    app.add_option("--listen", args.listen, "ADDRESS:PORT of a sensor's stream; again for each further --sensor")
        .show_default();
    app.add_option("--allow", args.stream.allow, "ADDRESS/BITS of clients; needed beyond the loopback");
    app.add_option("--http-port", args.http_port,
                   "serves netftapi2.xml, from which clients take counts and units, on the "
                   "stream's address; a Net F/T has 80; default: none")
        .integer_in(1, 65535);
    app.add_option("--zero", args.zero, "axes that the sensor does not measure and that are sent as 0, such as mx,my,mz")
        .delimiter(',')
        .one_of({"fx", "fy", "fz", "mx", "my", "mz"});
    app.add_flag("--good-only", args.stream.good_only, "sends nothing while a value is uncertain, either");
    app.add_flag("--bias", args.stream.bias,
                 "lets a client set the zero of its own stream; the daemon's values stay as they are");
    app.add_option("--counts-per-N", args.stream.scale.counts_per_N, "scale of the forces, as the client expects it")
        .number_in(1, 1e9)
        .show_default();
    app.add_option("--counts-per-Nm", args.stream.scale.counts_per_Nm, "scale of the torques")
        .number_in(1, 1e9)
        .show_default();
    app.footer(
        "Examples:\n"
        "  tactiled-rdt --sensor wrist                            six axes, for clients on this machine\n"
        "  tactiled-rdt --sensor left --zero mx,my,mz             a sensor of three axes\n"
        "  tactiled-rdt --sensor left --zero mx,my,mz --http-port 8090\n"
        "  tactiled-rdt --sensor left --listen 192.168.1.1:49152 --allow 192.168.1.20/32 --zero mx,my,mz\n"
        "  tactiled-rdt --sensor left --listen 127.0.0.1:49152 --sensor right --listen 127.0.0.2:49152 --zero mx,my,mz");
    return ctl::run_program(app, argc, argv, [&] {
        args.stream.rate_Hz = args.common.rate_Hz;
        return rdt::Server(args).serve();
    });
}
