#include "node/reload.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "config/keys.hpp"
#include "node/log.hpp"

namespace tactiled {
namespace {

constexpr int kPatienceMs = 1000;  // time for the pipeline to respond
constexpr char kRestart[] = "cannot change while the daemon runs; restart it (systemctl restart tactiled)";

bool is_jaw(const std::optional<Grasping::Setup>& grasp, std::uint32_t sensor) {
    return grasp && std::any_of(grasp->estimator.jaws.begin(), grasp->estimator.jaws.end(),
                                [&](const grasp::JawSetup& jaw) { return jaw.sensor == sensor; });
}

}  // namespace

Reloader::Reloader(const Node& running, std::string costs_folder, ZeroStore* zeros)
    : running_(running), costs_folder_(std::move(costs_folder)), zeros_(zeros), now_(accepted(running)) {}

Reloader::Accepted Reloader::accepted(const Node& node) {
    return {node.config.root,
            node.config.sensors,
            node.calibrations,
            node.grasp,
            node.tool,
            node.config.grasp ? node.config.grasp->objects : "",
            node.plan.calibration_id};
}

void Reloader::reload(Pipeline& pipeline) noexcept try {
    Problems problems;
    const std::string done = try_reload(pipeline, problems);
    for (const auto& line : problems.lines()) log_text(LogLevel::error, line);
    if (!problems.empty()) log_line(LogLevel::error, "SIGHUP: refused, nothing was changed");
    if (!done.empty()) log_line(LogLevel::info, "SIGHUP: {}", done);
    pipeline.reload_refused(done.empty());
} catch (const std::exception& error) {
    const bool memory = dynamic_cast<const std::bad_alloc*>(&error) != nullptr;
    log_line(LogLevel::error, "SIGHUP: refused, nothing was changed: {}", memory ? "there is no memory" : error.what());
    pipeline.reload_refused(true);
}

// Returns the changes, or "" with the reasons in `problems`.
std::string Reloader::try_reload(Pipeline& pipeline, Problems& problems) {
    Node fresh = load_node(running_.config.path, problems, costs_folder_);
    if (problems.empty()) refuse_what_needs_a_restart(fresh);
    if (problems.empty()) refuse_a_loss_once(fresh);
    if (!problems.empty()) return "";

    Accepted next = accepted(fresh);  // all code that may throw runs before the exchange
    Replacement replacement = difference(fresh);
    std::vector<std::string> names;
    for (const auto& part : replacement.sensors)
        names.push_back(fmt::format("sensor \"{}\"{}", next.sensors[part.index].name,
                                    part.measures_alike ? "" : " (a new epoch, without its tare)"));
    if (replacement.grasping != nullptr) names.push_back(now_.tool ? "the grasp or the tool" : "the grasp");
    std::string done = names.empty() ? "neither the configuration nor a calibration has changed"
                                     : fmt::format("changed {}", fmt::join(names, ", "));
    if (names.empty() && next.calibration_id == now_.calibration_id) return done;  // the files are unchanged
    for (const auto& part : replacement.sensors)
        if (zeros_ != nullptr && !part.measures_alike) zeros_->replace_owner(part.index, fresh.zeros[part.index]);
    if (!pipeline.replace(replacement, kPatienceMs)) {
        problems.add(running_.config.path, 0,
                     fmt::format("the pipeline did not respond within {} ms; the reload was aborted", kPatienceMs));
        return "";
    }
    now_ = std::move(next);
    announced_.clear();
    return done;
}

void Reloader::refuse_what_needs_a_restart(Node& fresh) const {
    Options& root = fresh.config.root;
    for (const auto& key : root.differing_keys(now_.root))
        if (needs_restart(key)) root.problem(key, fmt::format("[{}] {}", key, kRestart));
    if (!std::ranges::equal(fresh.config.sensors, now_.sensors, {}, &SensorSettings::name, &SensorSettings::name))
        return root.problem("sensor", fmt::format("which [[sensor]] there are {}", kRestart));
    for (std::size_t i = 0; i < now_.sensors.size(); ++i) {
        Options& sensor = fresh.config.sensors[i].options;
        for (const auto& key : sensor.differing_keys(now_.sensors[i].options))
            if (reload_rule("sensor", key) == Reload::restart) sensor.problem(key, fmt::format("{} {}", key, kRestart));
    }
    for (std::size_t i = 0; i < now_.sensors.size(); ++i) {
        const auto array = [i](const Node& node) {
            const tactiled_sensor& s = node.plan.sensors[i];
            return std::tie(s.n_taxels, s.taxel_components, s.taxel_rows, s.taxel_columns, node.plan.places[i]);
        };
        if (array(fresh) != array(running_))
            fresh.config.sensors[i].options.problem("calibration",
                                                    fmt::format("the places and components of taxels {}", kRestart));
    }
    if (fresh.grasp.has_value() != now_.grasp.has_value())
        return root.problem("grasp", fmt::format("whether there is a [grasp] {}", kRestart));
    if (fresh.tool.has_value() != now_.tool.has_value())
        return root.problem("tool", fmt::format("whether there is a [tool] {}", kRestart));
    if (!fresh.config.grasp) return;
    Options before = now_.root, grasp = root.table("grasp");
    const bool same_objects = fresh.config.grasp->objects == now_.objects;  // the same file, another spelling
    for (const auto& key : grasp.differing_keys(before.table("grasp")))
        if (reload_rule("grasp", key) == Reload::restart && !(key == "objects" && same_objects))
            grasp.problem(key, fmt::format("{} {}", key, kRestart));
}

void Reloader::refuse_a_loss_once(Node& fresh) {
    std::vector<std::string> lost = fresh.config.root.lost_keys(now_.root);
    if (lost == std::exchange(announced_, lost)) return;
    for (const auto& key : lost)
        fresh.config.root.problem("", fmt::format("{} is not in the file any more; if that is right, reload again", key));
}

bool Reloader::measures_alike(const Node& fresh, std::size_t i) const {
    const auto keys = fresh.config.sensors[i].options.differing_keys(now_.sensors[i].options);
    return fresh.calibrations[i] == now_.calibrations[i] &&
           std::all_of(keys.begin(), keys.end(),
                       [](const std::string& key) { return reload_rule("sensor", key) == Reload::tune; });
}

Replacement Reloader::difference(Node& fresh) const {
    Replacement replacement;
    replacement.calibration_id = fresh.plan.calibration_id;
    bool regrasp =
        fresh.grasp && !(fresh.grasp->estimator == now_.grasp->estimator &&
                         fresh.grasp->settable == now_.grasp->settable);  // objects: as in the running configuration
    regrasp |= fresh.tool != now_.tool;
    for (std::uint32_t i = 0; i < fresh.sensors.size(); ++i) {
        const bool alike = measures_alike(fresh, i);
        // a pair may be configured in the other sensor's table
        const bool same_pair = fresh.config.sensors[i].pair == now_.sensors[i].pair;
        if (alike && same_pair && fresh.config.sensors[i].options.differing_keys(now_.sensors[i].options).empty()) continue;
        replacement.sensors.push_back(
            {i, alike, std::make_unique<Sensor>(std::move(fresh.sensors[i])), fresh.plan.sensors[i]});
        regrasp |= !alike && is_jaw(fresh.grasp, i);  // the forces of this jaw differ, and therefore the scale of the weight
    }
    if (regrasp) replacement.grasping = std::make_unique<Grasping>(fresh.grasp, fresh.tool);
    return replacement;
}

}  // namespace tactiled
