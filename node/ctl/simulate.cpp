// tactilectl simulate: a scene as signals and truth, without the daemon; or as devices behind ptys, for it.
#include "node/ctl/simulate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <numeric>

#include "config/text_file.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

struct Wish {
    std::string scene, effects = "auto", out, truth, report, figure, sensor;
    std::vector<std::string> ptys;
    Wire wire;
    double speed = 1;
    bool json = false, list = false;
};

void print(const nlohmann::json& json) {
    fmt::print("{}\n", json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

// No file that is written may be another that is written or the scene itself.
void check_files(const Wish& wish) {
    namespace fs = std::filesystem;
    const std::pair<const char*, const std::string*> files[] = {{"--scene", &wish.scene},
                                                                {"--out", &wish.out},
                                                                {"--truth", &wish.truth},
                                                                {"--report", &wish.report},
                                                                {"--figure", &wish.figure}};
    for (const auto& [name, path] : files)
        for (const auto& [other_name, other] : files) {
            if (other == path) break;  // those before it
            std::error_code ignored;
            if (path->empty() || other->empty()) continue;
            if (fs::path(*path).lexically_normal() == fs::path(*other).lexically_normal() ||
                fs::equivalent(*path, *other, ignored))
                throw SetupError(fmt::format("{} {}: is {} too; name another", name, in_quotes(*path), other_name));
        }
    if (wish.json && (wish.out == "-" || wish.truth == "-"))
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

int list_effects(const Wish& wish) {
    if (wish.json)
        print(effects_json());
    else
        fmt::print("{}", effects_text());
    return kGood;
}

int simulate(const Wish& wish) {
    if (wish.list) return list_effects(wish);
    if (wish.scene.empty()) throw SetupError("--scene: name the scene's file, or ask for --list");
    check_files(wish);
    const sim::Scene scene = sim::read_scene(wish.scene);
    const auto sensors = sensors_of(scene, wish.sensor);
    const sim::Simulation chosen(scene, wish.effects);
    const bool files = !wish.out.empty() || !wish.truth.empty();
    if (files) write_csv(scene, wish.effects, wish.out, wish.truth);
    if (!wish.figure.empty()) replace_file(wish.figure, timeline_svg(scene, scene.sensors[sensors.front()]));
    if (!wish.report.empty() || wish.json) {
        Report report{chosen, wish.effects, sensors, {}};
        for (const std::size_t i : sensors) report.measured.push_back(measure(scene, wish.effects, i));
        if (!wish.report.empty()) replace_file(wish.report, scene_html(report));
        if (wish.json) print(scene_json(report));
    } else if (!files && wish.figure.empty() && wish.ptys.empty()) {
        fmt::print("{}", choice_text(chosen, sensors));
    }
    if (!wish.ptys.empty()) return play_scene(scene, wish.effects, wish.ptys, wish.wire, wish.speed);
    return kGood;
}

}  // namespace

void add_simulate(CLI::App& app, Run& run) {
    auto wish = std::make_shared<Wish>();
    auto* verb = add_verb(app, "simulate", "Computes what sensors would read in a scene, with the effects it calls for");
    verb->add_option("--scene", wish->scene, "the scene, config/scenes/*.toml");
    verb->add_option("--effects", wish->effects,
                     "auto: those that the scene calls for; all; none; or names with commas, see --list")
        ->capture_default_str();
    verb->add_option("--out", wish->out, "signals.csv: t_s and a column a channel; - is standard output");
    verb->add_option("--truth", wish->truth, "truth.csv: the loads and the centre of contact; - is standard output");
    verb->add_option("--report", wish->report,
                     "a page on each effect: bound, cost, on or off and why, measured share, and the figure");
    verb->add_option("--figure", wish->figure, "the figure alone, SVG: when the effects come on; of the first sensor");
    verb->add_option("--sensor", wish->sensor, "report, figure and JSON of this sensor alone");
    verb->add_option("--pty", wish->ptys,
                     "be the sensors' device behind this name; one for each sensor, or one for all with --format cobs")
        ->allow_extra_args(false);
    wish->wire.add_options(verb);
    verb->add_option("--speed", wish->speed, "with --pty: times faster than the scene")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    verb->add_flag("--json", wish->json, "print what --report says as JSON; with --list the effects");
    verb->add_flag("--list", wish->list, "print all effects: equation, source, parameters");
    verb->callback([wish, &run] { run = [wish] { return simulate(*wish); }; });
}

}  // namespace tactiled::ctl
