// tactiled-mqtt: forces, qualities and the grasp of a daemon as JSON messages to an MQTT broker.
#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "config/options.hpp"
#include "config/text_file.hpp"
#include "node/bridges/bridge.hpp"
#include "node/bridges/mqtt_broker.hpp"
#include "node/bridges/mqtt_message.hpp"
#include "node/ctl/command_line.hpp"

namespace tactiled::bridges::mqtt {
namespace {

struct Args {
    Common common;
    BrokerOptions broker;
    std::string password_file, prefix = "tactiled", discovery;
    double deadband_N = 0, deadband_Nm = 0, refresh_s = 10;
};

constexpr std::uint64_t kStateEachNs = 10'000'000'000;
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
    args.broker.tls |= !args.broker.ca_file.empty() || !args.broker.certificate_file.empty();
    args.broker.password = password_in(args.password_file);
    if (!args.broker.tls && !is_loopback(args.broker.host))
        fmt::print(stderr, "tactiled-mqtt: warning: without --tls, forces{} can be read and changed on the way to {}\n",
                   args.broker.password.empty() ? "" : " and the password", args.broker.host);
}

// The topics and the last values of one sensor.
struct Sensor {
    std::uint32_t index;
    std::string wrench_topic, quality_topic;
    Batch batch;
    Pace pace;
    Deadband deadband;
    std::uint64_t published = ~std::uint64_t(0);  // quality and reasons
};

class Bridge {
public:
    explicit Bridge(const Args& args)
        : args_(args),
          topics_{args.prefix, args.common.node},
          follower_(args.common.node),
          broker_(args.broker, "tactiled-mqtt-" + args.common.node, topics_.state(), last_will_text()) {}

    int run() {
        ctl::catch_interrupt();
        report_.ready(fmt::format("node \"{}\" to {}", args_.common.node, args_.broker.host));
        const double rate_Hz = args_.common.rate_Hz;
        const std::uint64_t tick_ns =
            rate_Hz > 0 ? std::min(std::uint64_t(1e9 / rate_Hz), kLongestTickNs) : Follower::kSpacingNs;
        while (ctl::interrupted == 0) {
            follower_.look();
            if (std::exchange(structure_, follower_.structure()) != follower_.structure()) name_sensors();
            const std::uint32_t connections = broker_.connections();
            if (std::exchange(connections_, connections) != connections) greet();
            for (Sensor& sensor : sensors_) publish(sensor);
            publish_node();
            counts_.dropped += broker_.take_lost();
            report_.tick(follower_, counts_, broker_.state());
            follower_.wait(monotonic_ns() + std::max<std::uint64_t>(tick_ns, 20'000'000), tick_ns);
        }
        broker_.close(topics_.state(), last_will_text());
        counts_.dropped += broker_.take_lost();
        report_.ended(follower_, counts_);
        return ctl::kGood;
    }

private:
    void put(const std::string& topic, const std::string& text, bool retained) {
        ++(broker_.publish(topic, text, retained) ? counts_.sent : counts_.dropped);
    }

    void name_sensors() {
        sensors_.clear();
        for (std::uint32_t i = 0; i < follower_.n_sensors(); ++i) {
            const std::string name = follower_.segment().sensor(i).name;
            const auto& wanted = args_.common.sensors;
            if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), name) == wanted.end()) continue;
            sensors_.push_back({i,
                                topics_.of(name, "wrench"),
                                topics_.of(name, "quality"),
                                {},
                                Pace(args_.common.rate_Hz),
                                Deadband(args_.deadband_N, args_.deadband_Nm, args_.refresh_s)});
        }
        greet();
    }

    // Makes all retained messages due again, for a broker that has just been connected.
    void greet() {
        state_ns_ = 0;
        grasp_.clear();
        for (Sensor& sensor : sensors_) {
            sensor.published = ~std::uint64_t(0);
            if (!args_.discovery.empty() && broker_.is_connected())
                for (const auto& [topic, text] :
                     discovery(args_.discovery, topics_, follower_.segment().sensor(sensor.index)))
                    put(topic, text, true);
        }
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
        const auto quality = std::uint64_t(batch.newest.quality) << 32 | batch.newest.reasons;
        if (batch.newest.quality == TACTILED_NO_VALUE || quality == sensor.published || !broker_.is_connected()) return;
        sensor.published = quality;
        put(sensor.quality_topic, quality_text(batch.newest), true);
    }

    void publish_batch(Sensor& sensor) {
        Batch& batch = sensor.batch;
        if (!sensor.pace.passes(batch.newest) || !sensor.deadband.passes(batch.newest, monotonic_ns())) return;
        put(sensor.wrench_topic, wrench_text(batch), false);
        batch.samples = batch.bad = 0;
    }

    void publish_node() {
        if (!broker_.is_connected()) return;
        const std::uint64_t now_ns = monotonic_ns();
        const bool changed = std::exchange(alive_, follower_.is_alive()) != follower_.is_alive();
        if (changed || state_ns_ == 0 || now_ns - state_ns_ >= kStateEachNs) {
            state_ns_ = now_ns;
            put(topics_.state(), state_text(follower_, counts_), true);
        }
        if (!follower_.segment().is_open()) return;
        tactiled_grasp grasp = follower_.node().grasp;
        if (!follower_.is_alive()) tactiled_forget_grasp(&grasp);
        if (now_ns - grasp_ns_ < 100'000'000) return;
        grasp_ns_ = now_ns;
        std::string text = grasp_text(grasp);
        if (grasp_ == text) return;
        grasp_ = std::move(text);
        put(topics_.grasp(), grasp_, true);
    }

    const Args& args_;
    Topics topics_;
    Follower follower_;
    Broker broker_;
    std::vector<Sensor> sensors_;
    std::string grasp_;
    std::uint64_t structure_ = 0, state_ns_ = 0, grasp_ns_ = 0;
    std::uint32_t connections_ = 0;
    bool alive_ = false;
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
    app.add_option("--deadband-N", args.deadband_N, "a force that moved by less is not sent; 0: each is")
        .number_in(0, 1e6)
        .show_default();
    app.add_option("--deadband-Nm", args.deadband_Nm, "the same of torques").number_in(0, 1e6).show_default();
    app.add_option("--refresh-s", args.refresh_s, "a value that does not move is sent again after this time")
        .number_in(0.1, 3600)
        .show_default();
    app.add_option("--discovery", args.discovery, "announces the sensors below this topic, as Home Assistant finds them");
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
