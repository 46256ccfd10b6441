// tactiled-mqtt: forces, qualities and the grasp of a daemon as JSON messages to an MQTT broker.
#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "config/options.hpp"
#include "config/text_file.hpp"
#include "node/bridges/bridge.hpp"
#include "node/bridges/edge.hpp"
#include "node/bridges/mqtt_broker.hpp"
#include "node/bridges/mqtt_discovery.hpp"
#include "node/bridges/mqtt_message.hpp"
#include "node/ctl/command_line.hpp"

namespace tactiled::bridges::mqtt {
namespace {

struct Args {
    Common common;
    BrokerOptions broker;
    std::string password_file, prefix = "tactiled", discovery;
    double deadband_N = 0, deadband_Nm = 0;
};

constexpr std::uint64_t kLookEachNs = 100'000'000;    // for changes of the grasp: at most 10 messages a second
constexpr std::uint64_t kLongestTickNs = 50'000'000;  // the ring of one of 16 sensors holds 64 ms at 4 kHz

std::string password_in(const std::string& path) {
    if (path.empty()) return "";
    Problems problems;
    std::string password = read_text_file(path, 4096, problems).value_or("");
    problems.throw_if_any();
    password.erase(password.find_last_not_of("\r\n") + 1);
    return password;
}

bool is_loopback(const std::string& host) { return host == "localhost" || host == "::1" || host.rfind("127.", 0) == 0; }

void check(Args& args) {
    const auto is_topic = [](const std::string& text) {
        return !text.empty() && text.find_first_of("+#") == std::string::npos;
    };
    if (!is_topic(args.prefix)) throw SetupError("--prefix: a topic, without + and #");
    if (!args.discovery.empty() && !is_topic(args.discovery))
        throw SetupError("--discovery: a topic, such as homeassistant");
    if (args.common.rate_Hz > 0 && args.common.rate_Hz < 1)
        throw SetupError(
            fmt::format("--rate-Hz {}: 0, or 1 and more: a message expires after {} s", args.common.rate_Hz, kExpiryS));
    args.broker.tls |= !args.broker.ca_file.empty() || !args.broker.certificate_file.empty();
    args.broker.password = password_in(args.password_file);
    if (!args.broker.tls && !is_loopback(args.broker.host))
        fmt::print(stderr, "tactiled-mqtt: warning: without --tls, forces{} can be read and changed on the way to {}\n",
                   args.broker.password.empty() ? "" : " and the password", args.broker.host);
}

// A topic whose text is sent when it changes, and again before it expires.
struct Renewed {
    std::string topic, said;
    std::uint64_t sent_ns = 0;        // 0: is due
    std::uint32_t cleared_after = 0;  // number of the connection over which the broker was told to forget the topic
};

// The topics and the last values of one sensor.
struct Sensor {
    std::uint32_t index;
    std::string wrench_topic;
    Renewed quality;
    Batch batch;
    Pace pace;
    Deadband deadband;
};

class Bridge {
public:
    explicit Bridge(const Args& args)
        : args_(args),
          topics_{args.prefix, args.common.node},
          follower_(args.common.node),
          precedence_(args.common.node),
          broker_(args.broker, precedence_.mine().id, topics_.state(), last_will_text(), kExpiryS),
          tool_pace_(args.common.rate_Hz) {
        state_.topic = topics_.state();
        grasp_.topic = topics_.of_node("grasp");
        weight_.topic = topics_.of_node("weight");
    }

    int run() {
        ctl::catch_interrupt();
        report_.ready(fmt::format("node \"{}\" to {}", args_.common.node, args_.broker.host));
        const double rate_Hz = args_.common.rate_Hz;
        const std::uint64_t tick_ns =
            rate_Hz > 0 ? std::min(std::uint64_t(1e9 / rate_Hz), kLongestTickNs) : Follower::kSpacingNs;
        while (ctl::interrupted == 0) {
            follower_.look();
            if (std::exchange(structure_, follower_.structure()) != follower_.structure()) name_sensors();
            if (broker_.choose_version())
                fmt::print(stderr,
                           "tactiled-mqtt: the broker refuses MQTT 5: by 3.1.1, which has no expiry, no state is "
                           "retained, and a late subscriber waits for the next message\n");
            listen();
            for (Sensor& sensor : sensors_) publish(sensor);
            publish_node();
            counts_.dropped += broker_.take_lost();
            report_.tick(follower_, counts_, said());
            follower_.wait(monotonic_ns() + std::max<std::uint64_t>(tick_ns, 20'000'000), tick_ns);
        }
        if (!precedence_.is_silent()) broker_.close(topics_.state(), last_will_text());
        counts_.dropped += broker_.take_lost();
        report_.ended(follower_, counts_);
        return ctl::kGood;
    }

private:
    // Finds out whether this bridge may send, which it may not from the begin of a connection on.
    void listen() {
        const std::uint64_t now_ns = monotonic_ns();
        const std::uint32_t connection = broker_.connection();
        if (std::exchange(connection_, connection) != connection) precedence_.listen(now_ns);
        const std::string heard = broker_.take_heard();
        if (!heard.empty()) state_.sent_ns = 0;  // the last will of another bridge may be there in place of this state
        if (precedence_.hear(heard, now_ns)) greet();
    }

    [[nodiscard]] std::string said() const {
        return precedence_.gives_way()
                   ? "silent, because another bridge sends below " + topics_.prefix + "/" + topics_.node +
                         ": give one of the nodes another name, or one of the bridges another --prefix"
                   : broker_.state();
    }

    void put(const std::string& topic, const std::string& text, Keep keep) {
        if (precedence_.is_silent()) return;
        ++(broker_.publish(topic, text, keep) ? counts_.sent : counts_.dropped);
    }

    // Sends a text that has changed or that is due again. `same`: equal where nothing has changed.
    void renew(Renewed& renewed, const std::string& text, const std::string& same, Keep keep) {
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns - renewed.sent_ns < kRenewNs && renewed.said == same) return;
        renewed.said = same;
        renewed.sent_ns = now_ns;
        put(renewed.topic, text, keep);
    }

    void name_sensors() {
        sensors_.clear();
        names_.clear();
        for (std::uint32_t i = 0; i < follower_.n_sensors(); ++i) {
            const std::string name = follower_.segment().sensor(i).name;
            names_.push_back(name);
            const auto& wanted = args_.common.sensors;
            if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), name) == wanted.end()) continue;
            sensors_.push_back({i,
                                topics_.of(name, "wrench"),
                                {topics_.of(name, "quality"), "", 0},
                                {},
                                Pace(args_.common.rate_Hz),
                                Deadband(args_.deadband_N, args_.deadband_Nm)});
        }
        greet();
    }

    // Makes a message due again. An empty retained message precedes the first one of a connection: the broker forgets a
    // value that an earlier version retained without an end, or that the last will says for ever.
    void begin(Renewed& renewed) {
        renewed.sent_ns = 0;
        if (!broker_.is_connected() || precedence_.is_silent() || renewed.cleared_after == connection_) return;
        if (broker_.publish(renewed.topic, "", Keep::kForever)) renewed.cleared_after = connection_;
    }

    // Makes all messages due again, for a broker that may have none of them.
    void greet() {
        for (Renewed* renewed : {&state_, &grasp_, &weight_}) begin(*renewed);
        for (Sensor& sensor : sensors_) begin(sensor.quality);
        if (args_.discovery.empty() || !broker_.is_connected()) return;
        for (const Sensor& sensor : sensors_)
            announce(discovery(args_.discovery, topics_, follower_.segment().sensor(sensor.index)));
        announce(discovery(args_.discovery, topics_, has_grasp_, has_tool_));
    }

    void announce(const Announcements& announcements) {
        for (const auto& [topic, text] : announcements) put(topic, text, Keep::kForever);
    }

    void publish(Sensor& sensor) {
        tactiled_sample sample;
        Batch& batch = sensor.batch;
        while (follower_.next(sensor.index, sample)) {
            batch.newest = sample;
            ++batch.samples;
            batch.bad += sample.quality == TACTILED_BAD ? 1 : 0;
            if (args_.common.rate_Hz <= 0) publish_batch(sensor);
        }
        if (batch.samples != 0) publish_batch(sensor);
        if (batch.newest.quality == TACTILED_NO_VALUE || !broker_.is_connected()) return;
        sample = batch.newest;  // it may have become old since
        tactiled_judge(&sample, follower_.segment().c()->stale_ms[sensor.index], monotonic_ns());
        renew(sensor.quality, quality_text(sample, follower_.is_simulated()),
              fmt::format("{} {}", sample.quality, sample.reasons), Keep::kValue);
    }

    void publish_batch(Sensor& sensor) {
        Batch& batch = sensor.batch;
        if (!sensor.pace.passes(batch.newest) || !sensor.deadband.passes(batch.newest, monotonic_ns())) return;
        put(sensor.wrench_topic,
            wrench_text(batch, valid_until_ns(follower_.segment(), sensor.index, batch.newest), follower_.is_simulated()),
            Keep::kValue);
        batch.samples = batch.bad = 0;
    }

    void publish_node() {
        if (!broker_.is_connected()) return;
        const std::uint64_t now_ns = monotonic_ns();
        const bool changed = std::exchange(alive_, follower_.is_alive()) != follower_.is_alive();
        if (!changed && state_.sent_ns != 0 && now_ns - looked_ns_ < kLookEachNs) return publish_tool();
        looked_ns_ = now_ns;
        const std::uint32_t worst = follower_.is_alive() ? worst_quality(follower_.segment()) : std::uint32_t(TACTILED_BAD);
        renew(state_, state_text(follower_, counts_, worst, precedence_.mine()),
              fmt::format("{} {} {}", follower_.is_alive(), worst, follower_.is_alive() ? follower_.node().fault : 0),
              Keep::kState);
        if (!follower_.segment().is_open()) return;
        const bool simulated = follower_.is_simulated();
        tactiled_grasp grasp = follower_.node().grasp;
        if (!follower_.is_alive()) tactiled_forget_grasp(&grasp);
        const std::string of_grasp = grasp_text(grasp, worst, simulated),
                          of_weight = weight_text(grasp, worst, names_, simulated);
        renew(grasp_, of_grasp, without_times(of_grasp), Keep::kValue);
        renew(weight_, of_weight, without_times(of_weight), Keep::kValue);
        const bool has_grasp = grasp.t_ns != 0, has_tool = follower_.node().tool.quality != TACTILED_NO_VALUE;
        if ((has_grasp && !has_grasp_) || (has_tool && !has_tool_)) {
            has_grasp_ |= has_grasp;
            has_tool_ |= has_tool;
            greet();
        }
        publish_tool();
    }

    // The wrench on the gripper, at the rate of the sensors.
    void publish_tool() {
        if (!follower_.segment().is_open()) return;
        tactiled_node node = follower_.node();
        if (!follower_.is_alive()) tactiled_forget_tool(&node.tool);
        const tactiled_tool& tool = node.tool;
        if (tool.quality == TACTILED_NO_VALUE) return;
        if (std::exchange(tool_t_ns_, tool.t_newest_ns) == tool.t_newest_ns && tool.quality == tool_quality_) return;
        if (!tool_pace_.passes(node.t_ns, tool_quality_ = tool.quality)) return;
        put(topics_.of_node("tool"), tool_text(tool, valid_until_ns(follower_.segment(), node), follower_.is_simulated()),
            Keep::kValue);
    }

    const Args& args_;
    Topics topics_;
    Follower follower_;
    Precedence precedence_;
    Broker broker_;
    std::vector<Sensor> sensors_;
    std::vector<std::string> names_;  // all sensors of the node
    Renewed state_, grasp_, weight_;
    Pace tool_pace_;
    std::uint64_t structure_ = 0, looked_ns_ = 0, tool_t_ns_ = 0;
    std::uint32_t connection_ = 0, tool_quality_ = TACTILED_NO_VALUE;
    bool alive_ = false, has_grasp_ = false, has_tool_ = false;
    Counts counts_;
    Report report_{"tactiled-mqtt"};
};

}  // namespace
}  // namespace tactiled::bridges::mqtt

int main(int argc, char** argv) {
    using namespace tactiled;
    using namespace tactiled::bridges;
    ctl::Program app{"Publishes forces, qualities and the grasp of a tactiled daemon as JSON to an MQTT broker.",
                     "tactiled-mqtt"};
    mqtt::Args args;
    args.common.rate_Hz = 10;
    add_common_options(app, args.common);
    app.add_option("--broker", args.broker.host, "name or address of the broker").show_default();
    app.add_option("--port", args.broker.port, "default: 1883, with TLS 8883").integer_in(1, 65535);
    app.add_option("--prefix", args.prefix, "first level of every topic").show_default();
    app.add_option("--deadband-N", args.deadband_N,
                   "a force that moved by less is sent twice a second only; 0: each is sent")
        .number_in(0, 1e6)
        .show_default();
    app.add_option("--deadband-Nm", args.deadband_Nm, "the same of torques").number_in(0, 1e6).show_default();
    app.add_option("--discovery", args.discovery, "announces the values below this topic, as Home Assistant finds them");
    app.add_option("--user", args.broker.user, "name at the broker");
    app.add_option("--password-file", args.password_file, "file with the password");
    app.add_flag("--tls", args.broker.tls, "encrypts; the broker's certificate must be of an authority of /etc/ssl/certs");
    app.add_option("--tls-ca", args.broker.ca_file, "file with the authority of the broker's certificate instead");
    app.add_option("--tls-certificate", args.broker.certificate_file, "file with a certificate of this client");
    app.add_option("--tls-key", args.broker.key_file, "and its key");
    app.footer(
        "Examples:\n"
        "  tactiled-mqtt                                       to a broker on this machine, 10 messages a second\n"
        "  mosquitto_sub -v -t 'tactiled/#'                    what it sends\n"
        "  tactiled-mqtt --rate-Hz 50 --deadband-N 0.05        small changes are left out\n"
        "  tactiled-mqtt --broker plant.example --tls --user gripper7 --password-file password --discovery homeassistant");
    return ctl::run_program(app, argc, argv, [&] {
        mqtt::check(args);
        return mqtt::Bridge(args).run();
    });
}
