// The scenes of config/scenes with an [[expect]], each with the calibration and the method that it names.
#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "consistency.hpp"
#include "decoupling/fit/fit.hpp"
#include "node/lab/simulate.hpp"

namespace tactiled {
namespace {

namespace fs = std::filesystem;

}  // namespace

std::vector<Expectation> expectations_of(const fs::path& path) {
    Problems problems;
    Options scene = Options::parse_file(path.string(), problems);
    std::vector<Expectation> result;
    for (Options& e : scene.tables("expect", 64)) {
        if (e.has("reads_N")) continue;  // its force is not the applied one
        result.push_back({e.text("sensor"), e.text("calibration"), e.text("method", ""), e.number("from_s", {0, 1e7}, 0),
                          e.number("to_s", {0, 1e7}, 1e7)});
    }
    return result;
}

CalibrationOfScene calibration_of_scene(const fs::path& path, const std::string& method) {
    CalibrationOfScene made{ctl::read_calibration_scene(path.string()),
                            {.model = "", .method = method, .serial = "", .date = ""}};
    made.request.model = made.scene.model;
    if (made.request.model.empty()) made.request.model = ctl::name_of(made.scene.scene.sensors.front().model);
    made.request.parameters = made.scene.known;
    if (!made.scene.influence.empty()) put_fit_option("influence", made.scene.influence, made.request);
    return made;
}

namespace {

Calibration calibrated(const fs::path& beside, const std::string& name, const std::string& method) {
    if (!name.starts_with("scene:")) {
        Problems problems;
        Calibration calibration = load_calibration((beside / name).string(), problems);
        problems.throw_if_any();
        return calibration;
    }
    const CalibrationOfScene made = calibration_of_scene(beside / name.substr(6), method);
    return fit(ctl::calibration_rows(made.scene, kMaxCalibrationRows), made.request).calibration;
}

}  // namespace

void print_titles(const std::string& first) {
    fmt::print("{:<50} {:>7} {:>8} {:>9} {:>8} {:>9} {:>10} {:>8} {:>8} {:>8} {:>11} {:>8}\n", first, "GOOD %", "in 1 sd",
               "over 5 sd", "not late", "sharpness", "no latency", "in 1 rms", "latency", "oracle's", "over 5 sd",
               "samples");
}

void print_shares(const std::string& first, const Shares& s) {
    fmt::print("{:<50} {:>7.2f} {:>8.1f} {:>9.2f} {:>8.2f} {:>9.2f} {:>10.2f} {:>8.1f} {:>8.2f} {:>8.2f} {:>11.2f} {:>8}",
               first, percent(s.good, s.samples), percent(s.within, s.values), percent(s.undetected, s.good),
               percent(s.wrong, s.good), s.sharpness_together, s.sharpness_without, percent(s.within_true, s.values),
               s.latency, s.latency_of_oracle, percent(s.undetected_by_oracle, s.good), s.samples);
    for (const auto& [reasons, n] : s.reasons)
        if (reasons != 0) fmt::print(" 0x{:x}:{:.1f}%", reasons, percent(n, s.samples));
    if (s.flagged_inside > 0) {
        fmt::print(" outside-domain inside full scale: {:.3f}% (by motion, channel, estimate, none of these:",
                   percent(s.flagged_inside, s.samples));
        for (const std::size_t n : s.inside_by) fmt::print(" {:.3f}", percent(n, s.samples));
        fmt::print(")");
    }
    fmt::print("\n");
    std::fflush(stdout);
}

std::vector<fs::path> scenes_in(const std::string& folder, const std::string& pattern) {
    std::vector<fs::path> scenes;
    for (const auto& entry : fs::directory_iterator(folder))
        if (entry.path().extension() == ".toml" &&
            (pattern.empty() || ::fnmatch(pattern.c_str(), entry.path().stem().c_str(), 0) == 0))
            scenes.push_back(entry.path());
    std::sort(scenes.begin(), scenes.end());
    return scenes;
}

const std::vector<Contested>& contested() {
    static const std::vector<Contested> all{
        {"tradeoff_table_calibrate", "tradeoff_table", {"linear", "matrix", "nonlinear"}},
        {"tradeoff_table_calibrate_place", "tradeoff_table", {"matrix", "map"}},
        {"tradeoff_hair_calibrate", "tradeoff_hair", {"sum_diff", "matrix", "physics"}},
        {"tradeoff_capacitive_calibrate", "tradeoff_capacitive", {"quadratic", "ratio", "overlap"}},
        {"tradeoff_generic_calibrate", "tradeoff_capacitive", {"matrix", "quadratic", "rbf"}},
    };
    return all;
}

void judge_scenes(const std::string& folder, const std::string& name) {
    const std::vector<fs::path> scenes = scenes_in(folder, name);
    std::map<std::string, Calibration> made;
    print_titles("scene, calibration, method");
    for (const fs::path& path : scenes)
        for (const Expectation& e : expectations_of(path)) {
            const std::string key = e.calibration + " " + e.method;
            if (made.count(key) == 0) made[key] = calibrated(path.parent_path(), e.calibration, e.method);
            const Candidate candidate{made[key].model, e.method, e.method, made[key]};
            sim::Scene scene = sim::read_scene(path.string());
            const std::vector<sim::Sensor> sensors = scene.sensors;
            for (const sim::Sensor& sensor : sensors) {
                if (::fnmatch(e.sensor.c_str(), sensor.name.c_str(), 0) != 0) continue;
                scene.sensors = {sensor};
                const Labelled rows = ctl::rows_of(scene, ctl::kMaxOfScene);
                Course course(candidate, rows, scene.delay_s(scene.sensors.front()));
                course.judge(rows, e.from_s, e.to_s);
                print_shares(fmt::format("{} {}, {}", path.stem().string(), sensor.name, key), course.shares());
            }
        }
}

}  // namespace tactiled
