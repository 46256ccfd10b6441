// The competing methods with their calibrations and scenes. One table; a model that is not in it has no contest.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <future>

#include "decoupling/fit/fit.hpp"
#include "decoupling/method.hpp"
#include "node/lab/simulate.hpp"
#include "node/lab/tradeoff.hpp"

namespace tactiled::ctl {
namespace {

// A calibration with more rows takes longer and is hardly better, because the loads matter. A method with memory
// needs the course of time.
constexpr std::size_t kMaxRows = 600, kMaxRowsOfMemory = 40'000;

struct Source {
    std::string model, scene;          // file without .toml
    std::vector<std::string> methods;  // a method without a fit of its own uses the first one's
    std::string how;                   // added to the method's name if the model has it from another scene, too
};
const std::vector<Source>& sources() {
    static const std::vector<Source> all{
        {"table", "tradeoff_table_calibrate", {"linear", "signs", "matrix", "nonlinear"}, ""},
        {"table", "tradeoff_table_calibrate_place", {"matrix", "map"}, "moments"},
        {"hair", "tradeoff_hair_calibrate", {"sum_diff", "matrix", "physics"}, ""},
        {"capacitive", "tradeoff_capacitive_calibrate", {"quadratic", "ratio", "overlap"}, ""},
        {"piezo", "calibrate_piezo", {"fused"}, ""},
        {"generic", "tradeoff_generic_calibrate", {"matrix", "quadratic", "rbf", "mlp"}, ""},
    };
    return all;
}

constexpr const char* kModels[] = {"table", "hair", "capacitive", "generic", "piezo"};
constexpr const char* kKinds[] = {"easy", "combined", "eccentric", "dynamic", kDamaged};

// The generic sensor is the pad with five electrodes, whose geometry the methods do not know; methods that know it
// are listed beside them.
std::string scene_of(const std::string& model, const std::string& kind) {
    if (model == "piezo" && kind == "dynamic") return "square_wave";
    return fmt::format("tradeoff_{}_{}", model == "generic" ? "capacitive" : model, kind);
}

std::string path_of(const std::string& folder, const std::string& scene) {
    return (std::filesystem::path(folder) / (scene + ".toml")).string();
}

struct Made {
    std::vector<Candidate> candidates;
    std::vector<std::string> refused;
};

// `sensor`: replaces the scene's own sensor.
Made calibrate(const std::string& folder, const Source& source, const sim::Sensor* sensor) {
    CalibrationScene scene = read_calibration_scene(path_of(folder, source.scene));
    if (sensor != nullptr) scene.scene.sensors = {*sensor};
    const FitEntry* const first = find_fit(source.model, source.methods.front());
    const Labelled rows = calibration_rows(scene, first != nullptr && first->remembers ? kMaxRowsOfMemory : kMaxRows);
    Made made;
    for (const auto& method : source.methods) {
        const bool twice = std::any_of(sources().begin(), sources().end(), [&](const Source& other) {
            return &other != &source && other.model == source.model &&
                   std::find(other.methods.begin(), other.methods.end(), method) != other.methods.end();
        });
        Candidate candidate{source.model, method, twice && !source.how.empty() ? method + ", " + source.how : method, {}};
        if (find_fit(source.model, method) == nullptr && !made.candidates.empty()) {
            candidate.calibration = made.candidates.front().calibration;
            made.candidates.push_back(std::move(candidate));
            continue;
        }
        FitRequest request{.model = source.model, .method = method, .serial = "", .date = ""};
        request.parameters = scene.known;
        if (!scene.influence.empty()) put_fit_option("influence", scene.influence, request);
        try {
            candidate.calibration = fit(rows, request).calibration;
            candidate.calibration.path = source.scene;
            made.candidates.push_back(std::move(candidate));
        } catch (const Undetermined& why) {
            made.refused.push_back(fmt::format("{}/{}: {}", source.model, candidate.name, why.what()));
        }
    }
    return made;
}

void add(Contest& contest, Made&& made) {
    std::move(made.candidates.begin(), made.candidates.end(), std::back_inserter(contest.candidates));
    std::move(made.refused.begin(), made.refused.end(), std::back_inserter(contest.refused));
}

}  // namespace

std::unique_ptr<Decoupler> Candidate::make() const { return make_decoupler(calibration, method); }

Trial trial_of(const std::string& kind, const std::string& path) {
    const sim::Scene scene = sim::read_scene(path);
    return {kind, rows_of(scene, kMaxOfScene), scene.delay_s(scene.sensors.front())};
}

std::vector<Contest> all_contests(const std::string& folder, const std::function<void(double)>& show,
                                  const std::string& model) {
    const auto is_left_out = [&model](const std::string& one) { return !model.empty() && one != model; };
    std::atomic<std::size_t> done = 0;
    std::vector<std::future<Made>> made;
    for (const Source& source : sources())
        made.push_back(std::async(std::launch::async, [&folder, &source, &done, &is_left_out] {
            Made m = is_left_out(source.model) ? Made{} : calibrate(folder, source, nullptr);
            ++done;
            return m;
        }));
    for (auto& one : made)
        while (one.wait_for(std::chrono::milliseconds(100)) != std::future_status::ready)
            show(double(done) / double(made.size()));
    std::vector<Contest> contests;
    for (const std::string name : kModels) {
        if (is_left_out(name)) continue;
        Contest contest{.model = name, .candidates = {}, .trials = {}, .refused = {}};
        for (std::size_t i = 0; i < made.size(); ++i)
            if (sources()[i].model == name) add(contest, made[i].get());
        for (const char* kind : kKinds) contest.trials.push_back(trial_of(kind, path_of(folder, scene_of(name, kind))));
        contests.push_back(std::move(contest));
    }
    return contests;
}

Contest contest_of_scene(const std::string& folder, const std::string& path) {
    const sim::Scene scene = sim::read_scene(path);
    const sim::Sensor& sensor = scene.sensors.front();
    Contest contest{.model = name_of(sensor.model), .candidates = {}, .trials = {}, .refused = {}};
    for (const Source& source : sources())
        if (source.model == contest.model) add(contest, calibrate(folder, source, &sensor));
    return contest;
}

Contest contest_of_calibration(const std::string& path) {
    Problems problems;
    const Calibration calibration = load_calibration(path, problems);
    problems.throw_if_any();
    Contest contest{.model = calibration.model, .candidates = {}, .trials = {}, .refused = {}};
    std::vector<std::string> methods{calibration.method};
    for (const Fit& other : calibration.others) methods.push_back(other.method);
    for (const MethodEntry* entry : methods_of(calibration.model))
        if (!entry->sd_of.empty() && entry->sd_of == calibration.method) methods.emplace_back(entry->method);
    for (const auto& method : methods) contest.candidates.push_back({calibration.model, method, method, calibration});
    return contest;
}

std::string scenes_folder() {
    namespace fs = std::filesystem;
    const fs::path program = fs::read_symlink("/proc/self/exe").parent_path();
    for (const char* place : {"../share/tactiled/scenes", "../../../config/scenes"})
        if (const fs::path folder = program / place; fs::is_directory(folder)) return folder.lexically_normal().string();
    throw SetupError(
        "the scenes are not beside this program: name their folder with --scenes, config/scenes of the sources");
}

}  // namespace tactiled::ctl
