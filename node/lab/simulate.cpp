// tactilectl simulate: writes a scene as signals and truth without the daemon, or plays it as devices behind ptys for
// the daemon.
#include "node/lab/simulate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <numeric>
#include <optional>

#include "config/text_file.hpp"
#include "node/ctl/command_line.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string scene, effects = "auto", out, truth, report, figure, sensor;
    std::vector<std::string> ptys;
    Wire wire;
    double speed = 1;
    std::optional<std::uint64_t> seed;
    bool json = false, list = false;
};

void print(const nlohmann::json& json) {
    fmt::print("{}\n", json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

// Checks that no output file is another output file or the scene itself.
void check_files(const Args& args) {
    namespace fs = std::filesystem;
    const std::pair<const char*, const std::string*> files[] = {{"--scene", &args.scene},
                                                                {"--out", &args.out},
                                                                {"--truth", &args.truth},
                                                                {"--report", &args.report},
                                                                {"--figure", &args.figure}};
    for (const auto& [name, path] : files)
        for (const auto& [other_name, other] : files) {
            if (other == path) break;  // compares with those before it only
            std::error_code ignored;
            if (path->empty() || other->empty()) continue;
            if (fs::path(*path).lexically_normal() == fs::path(*other).lexically_normal() ||
                fs::equivalent(*path, *other, ignored))
                throw SetupError(fmt::format("{} {}: is {} too; name another", name, in_quotes(*path), other_name));
        }
    if (args.json && (args.out == "-" || args.truth == "-"))
        throw SetupError("--json and a CSV cannot both go to standard output; name a file");
}

std::vector<std::size_t> sensors_of(const sim::Scene& scene, const std::string& name) {
    std::vector<std::size_t> sensors(scene.sensors.size());
    std::iota(sensors.begin(), sensors.end(), 0u);
    if (name.empty()) return sensors;
    std::vector<std::string> names;
    for (const auto& sensor : scene.sensors) names.push_back(sensor.name);
    const auto at = std::find(names.begin(), names.end(), name);
    if (at != names.end()) return {std::size_t(at - names.begin())};
    const auto nearest = nearest_name(name, names);
    throw SetupError(fmt::format("--sensor {}: the scene has none of that name; {} {}", in_quotes(name),
                                 nearest ? "did you mean" : "its first is", in_quotes(nearest ? *nearest : names.front())));
}

// The files and the report have channels; an array has its truth alone.
void refuse_arrays(const Args& args, const sim::Scene& scene) {
    const std::pair<const char*, bool> uses[] = {{"--out", !args.out.empty()},
                                                 {"--report", !args.report.empty()},
                                                 {"--figure", !args.figure.empty()},
                                                 {"--json", args.json},
                                                 {"--pty", !args.ptys.empty()}};
    for (const sim::Sensor& sensor : scene.sensors)
        for (const auto& [name, is_used] : uses)
            if (sensor.is_array() && is_used)
                throw SetupError(
                    fmt::format("{}: {} is an array of taxels: use --truth, and driver = \"sim\" for its taxels", name,
                                in_quotes(sensor.name)));
}

int list_effects(const Args& args) {
    if (args.json)
        print(effects_json());
    else
        fmt::print("{}", effects_text());
    return kGood;
}

int simulate(const Args& args) {
    if (args.list) return list_effects(args);
    if (args.scene.empty()) throw SetupError("--scene: name the scene's file, or ask for --list");
    check_files(args);
    sim::Scene scene = sim::read_scene(args.scene);
    if (args.seed) scene.seed = *args.seed;
    refuse_arrays(args, scene);
    const auto sensors = sensors_of(scene, args.sensor);
    const sim::Simulation chosen(scene, args.effects);
    const bool files = !args.out.empty() || !args.truth.empty();
    if (files) write_csv(scene, args.effects, args.out, args.truth);
    if (!args.figure.empty()) replace_file(args.figure, figure_svg(timeline_figure(scene, args.effects, sensors.front())));
    if (!args.report.empty() || args.json) {
        Report report{chosen, args.effects, sensors, {}};
        for (const std::size_t i : sensors) report.measured.push_back(measure(scene, args.effects, i));
        if (!args.report.empty()) replace_file(args.report, scene_html(report));
        if (args.json) print(scene_json(report));
    } else if (!files && args.figure.empty() && args.ptys.empty()) {
        fmt::print("{}", choice_text(chosen, sensors));
    }
    if (!args.ptys.empty()) return play_scene(scene, args.effects, args.ptys, args.wire, args.speed);
    return kGood;
}

}  // namespace

Run add_simulate(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("--scene", args->scene, "the scene, config/scenes/*.toml");
    verb.add_option("--effects", args->effects,
                    "auto: those that the scene needs; all; none; or names with commas, NAME or NAME:LEVEL, see --list")
        .show_default();
    verb.add_option("--seed", args->seed, "of noise and chance, instead of the scene's own")
        .integer_in(0, 9'000'000'000'000'000);
    verb.add_option("--out", args->out, "signals.csv: t_s and a column a channel; - is standard output");
    verb.add_option("--truth", args->truth, "truth.csv: the loads and the centre of contact; - is standard output");
    verb.add_option("--report", args->report,
                    "a page on each effect: the force without it, level, cost, on or off and why, and the figure");
    verb.add_option("--figure", args->figure, "only the figure, SVG: the effects of the first sensor over time");
    verb.add_option("--sensor", args->sensor, "report, figure and JSON of this sensor alone");
    verb.add_option("--pty", args->ptys,
                    "be the sensors' device behind this name; one for each sensor, or one for all with --format cobs")
        .one_value_each();
    args->wire.add_options(verb);
    verb.add_option("--speed", args->speed, "with --pty: times faster than the scene").positive().show_default();
    verb.add_flag("--json", args->json, "print the content of --report as JSON; with --list the effects");
    verb.add_flag("--list", args->list, "print all effects: equation, source, parameters");
    return [args] { return simulate(*args); };
}

}  // namespace tactiled::ctl
