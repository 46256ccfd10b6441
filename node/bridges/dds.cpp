// tactiled-dds: sensors, the wrench on the gripper and the grasp as topics of ROS 2, without ROS. A wrench that is not GOOD
// is not sent, because its message has no field for that; /diagnostics says why.
#include <fmt/format.h>

#include <algorithm>
#include <tuple>

#include "node/bridges/bridge.hpp"
#include "node/bridges/dds_domain.hpp"
#include "node/bridges/edge.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/status_text.hpp"

namespace tactiled::bridges::dds {
namespace {

struct Args {
    Common common;
    DomainOptions domain;
    std::string name, frame_prefix;
    bool uncertain = false;  // sends these values, too
    bool reliable = true;    // is the default
};

constexpr std::uint64_t kDiagnoseEachNs = 1'000'000'000;
constexpr std::uint64_t kDiagnoseAtMostNs = 50'000'000;  // also where a quality flickers
constexpr std::uint64_t kGraspEachNs = 50'000'000;  // before the grasp of a node with a stale_ms of 100 is no longer valid

struct Sensor {
    std::uint32_t index;
    std::string name, frame;
    Domain::Writer writer;
    Pace pace;
    tactiled_sample last{};
    std::uint64_t held = 0;  // samples that were not sent
};

class Bridge {
public:
    explicit Bridge(const Args& args)
        : args_(args),
          name_(args.name.empty() ? topic_word(args.common.node) : args.name),
          follower_(args.common.node),
          domain_(args.domain) {
        tool_.pace = Pace(args.common.rate_Hz);
    }

    int run() {
        ctl::catch_interrupt();
        report_.ready(fmt::format("node \"{}\" as /{}/SENSOR/wrench in domain {} on {}", args_.common.node, name_,
                                  args_.domain.domain,
                                  args_.domain.network.empty() ? "the loopback" : args_.domain.network));
        while (ctl::interrupted == 0) {
            follower_.look();
            if (std::exchange(structure_, follower_.structure()) != follower_.structure()) name_sensors();
            for (Sensor& sensor : sensors_) publish(sensor);
            publish_node();
            diagnose();
            report_.tick(follower_, counts_, readers_ == 0 ? "no reader" : fmt::format("{} readers", readers_));
            follower_.wait(monotonic_ns() + 20'000'000);
        }
        for (Sensor& sensor : sensors_) tactiled_invalidate(&sensor.last, TACTILED_DAEMON_STOPPED);
        ending_ = true;
        diagnosed_ns_ = 0;
        diagnose();
        report_.ended(follower_, counts_);
        return ctl::kGood;
    }

private:
    void name_sensors() {
        std::vector<std::string> names;
        for (std::uint32_t i = 0; i < follower_.n_sensors(); ++i) {
            const auto& wanted = args_.common.sensors;
            std::string name = follower_.segment().sensor(i).name;
            if (wanted.empty() || std::find(wanted.begin(), wanted.end(), name) != wanted.end())
                names.push_back(std::move(name));
        }
        for (const Sensor& sensor : sensors_)  // a topic that stays keeps its readers
            if (std::find(names.begin(), names.end(), sensor.name) == names.end()) domain_.remove(sensor.writer);
        std::vector<Sensor> now;
        for (const std::string& name : names) {
            const auto old = std::find_if(sensors_.begin(), sensors_.end(), [&](const Sensor& s) { return s.name == name; });
            const auto writer =
                old != sensors_.end() ? old->writer : domain_.wrench_writer(name_ + "/" + topic_word(name) + "/wrench");
            now.push_back({std::uint32_t(follower_.segment().find(name)), name, args_.frame_prefix + name, writer,
                           Pace(args_.common.rate_Hz)});
        }
        sensors_ = std::move(now);
        due_ = true;
    }

    // A wrench has no field for its quality.
    [[nodiscard]] bool may_be_sent(std::uint32_t quality) const {
        return is_healthy(quality) || (args_.uncertain && quality == TACTILED_UNCERTAIN);
    }

    void publish(Sensor& sensor) {
        tactiled_sample sample;
        while (follower_.next(sensor.index, sample)) {
            due_ |= sample.quality != sensor.last.quality || sample.reasons != sensor.last.reasons;
            sensor.last = sample;
            if (!may_be_sent(sample.quality)) {
                ++sensor.held;
                sensor.pace.passes(sample);
            } else if (sensor.pace.passes(sample)) {
                const bool sent =
                    domain_.write(sensor.writer, {sensor.frame, wall_s(sample.t_ns)}, sample.force_S_N, sample.torque_S_Nm);
                ++(sent ? counts_.sent : counts_.dropped);
            }
        }
    }

    // The grasp and the wrench on the gripper, if the node has them.
    void publish_node() {
        if (!follower_.segment().is_open() || (!follower_.is_alive() && !node_seen_)) return;
        tactiled_node node = follower_.node();
        node_seen_ = follower_.is_alive();
        if (!node_seen_) {
            tactiled_forget_grasp(&node.grasp);
            tactiled_forget_tool(&node.tool);
        }
        if (node.grasp.t_ns != 0) publish_grasp(node);
        due_ |= std::exchange(tool_quality_, node.tool.quality) != node.tool.quality;
        if (node.tool.quality != TACTILED_NO_VALUE) publish_tool(node);
    }

    void publish_tool(const tactiled_node& node) {
        const tactiled_tool& tool = node.tool;
        if (tool_.writer == 0) tool_.writer = domain_.wrench_writer(name_ + "/tool_wrench");
        if (std::exchange(tool_.t_ns, tool.t_newest_ns) == tool.t_newest_ns) return;
        if (!tool_.pace.passes(node.t_ns, tool.quality) || !may_be_sent(tool.quality)) return;
        const Stamped at{args_.frame_prefix + "G", wall_s(tool.t_ns)};
        ++(domain_.write(tool_.writer, at, tool.force_G_N, tool.torque_G_Nm) ? counts_.sent : counts_.dropped);
    }

    void publish_grasp(const tactiled_node& node) {
        const std::uint64_t now_ns = monotonic_ns();
        const tactiled_grasp& grasp = node.grasp;
        const auto news = std::tuple(grasp.state, grasp.weight_state, grasp.weight_doubts, grasp.slips, grasp.grasps);
        if (grasp_news_ == news && now_ns - grasp_.t_ns < kGraspEachNs) return;
        if (grasp_.writer == 0) grasp_.writer = domain_.grasp_writer(name_ + "/grasp");
        grasp_.t_ns = now_ns;
        grasp_news_ = news;
        const std::uint32_t worst = node_seen_ ? worst_quality(follower_.segment()) : std::uint32_t(TACTILED_BAD);
        const Stamped at{args_.frame_prefix + "G", wall_s(grasp.t_ns)};
        const double until_s = wall_s(valid_until_ns(follower_.segment(), node));
        const bool sent =
            domain_.write(grasp_.writer, at, until_s, grasp, grasp_quality(grasp, worst), weight_quality(grasp, worst));
        ++(sent ? counts_.sent : counts_.dropped);
    }

    // The wrench on the gripper, if the node has it: its message has no field for its quality, either.
    void diagnose_tool(const std::string& prefix, bool alive, std::vector<Diagnosis>& all) const {
        if (!follower_.segment().is_open() || tool_quality_ == TACTILED_NO_VALUE) return;
        tactiled_tool tool = follower_.node().tool;
        if (!alive) tactiled_forget_tool(&tool);
        const std::string why = ctl::tool_why_text(tool.why);
        all.push_back({prefix + ": tool_wrench",
                       ctl::quality_text(tool.quality, 0) + (why.empty() ? "" : ": " + why),
                       std::uint8_t(alive ? edge_of(tool.quality).level : 3),
                       {{"valid_ms", std::to_string(tactiled_node_limit_ms(follower_.segment().c()))}}});
    }

    void diagnose() {
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns - diagnosed_ns_ < (due_ ? kDiagnoseAtMostNs : kDiagnoseEachNs)) return;
        diagnosed_ns_ = now_ns;
        due_ = false;
        const std::string prefix = "tactiled: " + args_.common.node;
        const bool alive = follower_.is_alive() && !ending_;
        std::vector<Diagnosis> all{{prefix,
                                    ending_ ? "the bridge has ended"
                                    : alive ? "publishes"
                                            : follower_.why(),
                                    std::uint8_t(alive ? follower_.node().fault != 0 ? 1 : 0 : 3),
                                    {{"sent", std::to_string(counts_.sent)},
                                     {"dropped", std::to_string(counts_.dropped)},
                                     {"missed", std::to_string(follower_.missed())}}}};
        readers_ = 0;
        for (const Sensor& sensor : sensors_) {
            readers_ += domain_.readers(sensor.writer);
            const tactiled_sample& s = sensor.last;
            if (s.quality == TACTILED_NO_VALUE) continue;
            all.push_back({prefix + ": " + sensor.name,
                           ctl::quality_text(s.quality, s.reasons),
                           diagnostic_level(s.quality, s.reasons),
                           {{"held samples", std::to_string(sensor.held)},
                            {"valid_ms", std::to_string(follower_.segment().c()->stale_ms[sensor.index])},
                            {"lost frames", std::to_string(s.lost)},
                            {"rate_Hz", fmt::format("{:.1f}", s.rate_Hz)}}});
        }
        diagnose_tool(prefix, alive, all);
        if (!domain_.write(wall_s(now_ns), all)) ++counts_.dropped;
    }

    const Args& args_;
    std::string name_;
    Follower follower_;
    Domain domain_;
    std::vector<Sensor> sensors_;
    std::uint64_t structure_ = 0, diagnosed_ns_ = 0;
    struct Part {  // a topic of the node; without a writer until the node has it
        Domain::Writer writer = 0;
        Pace pace{0};
        std::uint64_t t_ns = 0;  // when it was last sent
    } tool_, grasp_;
    std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t> grasp_news_;
    std::uint32_t readers_ = 0, tool_quality_ = TACTILED_NO_VALUE;
    bool due_ = true, ending_ = false, node_seen_ = false;
    Counts counts_;
    Report report_{"tactiled-dds"};
};

}  // namespace
}  // namespace tactiled::bridges::dds

int main(int argc, char** argv) {
    using namespace tactiled;
    using namespace tactiled::bridges;
    ctl::Program app{
        "Publishes forces of a tactiled daemon as topics of ROS 2 (geometry_msgs/WrenchStamped by DDS), without ROS.",
        "tactiled-dds"};
    dds::Args args;
    add_common_options(app, args.common);
    app.add_option("--domain", args.domain.domain, "as ROS_DOMAIN_ID").integer_in(0, 232).show_default();
    app.add_option(
        "--network", args.domain.network,
        "name or address of the network interface; default: the loopback, for ROS nodes with ROS_LOCALHOST_ONLY=1");
    app.add_option("--name", args.name, "first part of the topics NAME/SENSOR/wrench; default: the node's name")
        .check([](const std::string& name) {
            return name == bridges::topic_word(name) ? std::string() : "letters, digits and underscores, not first a digit";
        });
    app.add_option("--frame-prefix", args.frame_prefix, "put before the sensor's name in header.frame_id");
    app.add_flag(
        "--many", args.domain.many,
        "for many bridges on one machine's loopback: they do not discover each other; readers need a participant number");
    const auto best_effort = app.add_flag("--best-effort", args.domain.best_effort,
                                          "of the wrenches; default: reliable, as ROS 2 subscribes by default");
    app.add_flag("--reliable", args.reliable, "the default; for command lines of older versions").excludes(best_effort);
    app.add_flag("--uncertain", args.uncertain, "sends wrenches that are UNCERTAIN, too: their message does not say so");
    app.footer(
        "Examples:\n"
        "  tactiled-dds                                            /gripper/left/wrench on this machine\n"
        "  ROS_LOCALHOST_ONLY=1 ros2 topic echo /gripper/left/wrench "
        "geometry_msgs/msg/WrenchStamped\n"
        "  tactiled-dds --network eth0 --domain 7                  for other machines\n"
        "  ros2 topic echo /diagnostics diagnostic_msgs/msg/DiagnosticArray");
    return ctl::run_program(app, argc, argv, [&] { return dds::Bridge(args).run(); });
}
