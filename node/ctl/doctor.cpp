// tactilectl doctor: reports what prevents the daemon from meeting its deadlines on this machine.
#include <fmt/format.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "node/ctl/command_line.hpp"
#include "node/ctl/doctor/doctor.hpp"
#include "node/ctl/liveness.hpp"
#include "node/ctl/verb.hpp"
#include "node/setup.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

using doctor::Finding;
using doctor::Findings;
using doctor::Machine;
using doctor::Verdict;

constexpr const char* kVerdict[] = {"good", "advice", "wrong"};

struct Args {
    std::string config = "/etc/tactiled/tactiled.toml";
    std::string user, root, pid;
    bool json = false;
};

// Returns the process number of the daemon of this configuration, or "" if none runs.
std::string running_daemon(const std::string& node_name) {
    std::string unused;
    const Segment segment = Segment::try_open(node_name, unused);
    const std::string pid = segment.is_open() ? fmt::format("{}", segment.header().pid) : "";
    return !pid.empty() && Machine("").line("/proc/" + pid + "/comm") == "tactiled" ? pid : "";
}

// The owner of the running daemon, else the package's user if there is one, else the caller.
std::string user_of(const Machine& machine, const std::string& pid) {
    struct stat process {};
    if (!pid.empty() && ::stat(machine.path("/proc/" + pid).c_str(), &process) == 0)
        if (const passwd* owner = ::getpwuid(process.st_uid)) return owner->pw_name;
    for (const auto& line : machine.lines("/etc/passwd"))
        if (line.starts_with("tactiled:")) return "tactiled";
    const passwd* self = ::getpwuid(::geteuid());
    return self != nullptr ? self->pw_name : "root";
}

// Reports a daemon that was killed, or that accepts no commands.
void look_at_daemon(const std::string& node_name, Findings& found) {
    std::string unused;
    const Segment segment = Segment::try_open(node_name, unused);
    if (!segment.is_open()) return;
    const Liveness liveness = liveness_of(segment);
    if (!liveness.runs())
        found.wrong("daemon", liveness.why, "systemctl restart tactiled, or start it by hand");
    else if (const std::string fault = control_fault(segment); !fault.empty())
        found.wrong("control", fault, "the daemon's log has the reason");
}

Findings examine(const Args& args) {
    const Machine machine(args.root);
    Findings found;
    Problems problems;
    Node node = load_node(args.config, problems);
    Config& config = node.config;
    for (const auto& line : problems.lines())
        found.wrong("configuration", line, fmt::format("tactilectl check {}", args.config));
    if (problems.empty()) found.good("configuration", args.config);

    const std::string pid = !args.pid.empty() ? args.pid : machine.is_this_one() ? running_daemon(config.node.name) : "";
    const std::string user = args.user.empty() ? user_of(machine, pid) : args.user;
    look_at_rights(machine, pid.empty() ? "self" : pid, config.realtime, found);
    look_at_sandbox(machine, pid.empty() ? "self" : pid, found);
    look_at_kernel(machine, found);
    look_at_clock(machine, found);
    look_at_processors(machine, config.realtime, found);
    if (!problems.empty()) return found;
    look_at_devices(machine, config, user, found);
    look_at_freshness(node, found);
    look_at_identity(node, found);
    if (config.grasp)
        for (const std::string& advice : grasp_advice(*config.grasp))
            found.advice("grasp", advice, "decoupling/grasp/README.md has the frames");
    look_at_safety(node, found);
    look_at_readers(machine, config, found);
    look_at_port(machine, config.modbus, !pid.empty(), found);
    if (machine.is_this_one()) look_at_daemon(config.node.name, found);
    return found;
}

void print(const Findings& found) {
    for (const auto& f : found) {
        fmt::print("{:<7} {:<14} {}\n", kVerdict[int(f.verdict)], f.check, f.says);
        if (!f.remedy.empty()) fmt::print("{:<7} {:<14}   -> {}\n", "", "", f.remedy);
    }
}

nlohmann::json as_json(const Findings& found, bool good) {
    nlohmann::json out{{"schema", 1}, {"good", good}, {"findings", nlohmann::json::array()}};
    for (const auto& f : found)
        out["findings"].push_back(
            {{"check", f.check}, {"verdict", kVerdict[int(f.verdict)]}, {"says", f.says}, {"remedy", f.remedy}});
    return out;
}

}  // namespace

Run add_doctor(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("--config", args->config, "the daemon's configuration").show_default();
    verb.add_option("--user", args->user,
                    "the daemon's user; default: the running daemon's, else tactiled, else the caller");
    verb.add_option("--pid", args->pid, "the daemon; default: the one that runs under the configuration's name");
    verb.add_option("--root", args->root, "the folder of another machine's /proc, /sys, /dev and /etc");
    verb.add_flag("--json", args->json, "one JSON object");
    return [args] {
        const Findings found = examine(*args);
        const bool good =
            std::none_of(found.begin(), found.end(), [](const Finding& f) { return f.verdict == Verdict::wrong; });
        if (args->json)
            fmt::print("{}\n", as_json(found, good).dump());
        else
            print(found);
        return good ? kGood : kUnhealthy;
    };
}

}  // namespace tactiled::ctl
