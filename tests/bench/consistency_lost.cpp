// The GOOD samples that the checks of consistency cost where nothing is damaged.
#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "consistency.hpp"
#include "node/lab/simulate.hpp"

namespace tactiled {
namespace {

namespace fs = std::filesystem;

// The numbers of put_frozen() in node/setup.cpp.
constexpr int kFrozenAfter = 100, kFrozenTimes = 10;
constexpr double kFrozenUnknown_s = 10;

}  // namespace

std::vector<bool> is_frozen(const Candidate& candidate, const Labelled& rows) {
    const Repeats& repeats = candidate.calibration.repeats;
    std::vector<double> storage;
    const auto readings = ctl::readings_of(candidate, rows, storage);
    std::vector<int> equal(candidate.calibration.channels.size(), 1);
    std::vector<std::uint64_t> moved_ns(equal.size());
    std::vector<bool> frozen(readings.size());
    for (std::size_t i = 1; i < readings.size(); ++i)
        for (std::size_t k = 0; k < equal.size(); ++k) {
            const bool repeats_now = readings[i].channel[k] == readings[i - 1].channel[k];
            equal[k] = repeats_now ? equal[k] + 1 : 1;
            if (!repeats_now) moved_ns[k] = readings[i].t_ns;
            const int run = repeats.readings.empty() ? 0 : repeats.readings[k];
            if (!repeats.readings.empty() && run == 0) continue;
            const int after = std::max(kFrozenAfter, kFrozenTimes * run);
            const double longest_s = repeats.readings.empty() ? kFrozenUnknown_s : kFrozenTimes * run * repeats.interval_s;
            if (equal[k] >= after && double(readings[i].t_ns - moved_ns[k]) * 1e-9 >= longest_s) frozen[i] = true;
        }
    return frozen;
}

namespace {

struct Lost {
    std::size_t samples = 0, good = 0, by_monitor = 0, by_disagreement = 0;
    double frozen = 0;
    bool has_monitor = false;
};

Shares shares_of(const Candidate& candidate, const Labelled& rows, const sim::Scene& scene, const Expectation& e) {
    Course course(candidate, rows, scene.delay_s(scene.sensors.front()));
    course.judge(rows, e.from_s, e.to_s);
    return course.shares();
}

void add(const Candidate& all, const sim::Scene& scene, const Expectation& e, Lost& lost) {
    const Labelled rows = ctl::rows_of(scene, ctl::kMaxOfScene);
    Candidate none = all;
    none.calibration.monitor = {};
    const Shares without = shares_of(none, rows, scene, e);
    lost.samples += without.samples;
    lost.good += without.good;
    for (const auto& [reasons, n] : without.reasons)
        if (reasons == TACTILED_DISAGREEMENT || reasons == (TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY))
            lost.by_disagreement += n;
    lost.by_monitor += without.good - shares_of(all, rows, scene, e).good;
    lost.has_monitor = all.calibration.monitor.limit > 0;
    const std::vector<bool> frozen = is_frozen(all, rows);
    lost.frozen = std::max(lost.frozen, percent(std::size_t(std::count(frozen.begin(), frozen.end(), true)), frozen.size()));
}

}  // namespace

void judge_lost(const std::string& folder, std::uint64_t first, std::uint64_t count, const std::string& name) {
    fmt::print(
        "% of the GOOD samples without the monitor that are lost by it; % of the samples: "
        " disagreement alone (the method's own check), frozen\n");
    std::map<std::string, Calibration> made;
    const auto judge = [&](const fs::path& path, const Expectation& e) {
        const std::string key = e.calibration + " " + e.method;
        const sim::Scene original = sim::read_scene(path.string());
        const bool is_made = e.calibration.starts_with("scene:");
        if (made.count(key) == 0 && is_made) {
            CalibrationOfScene of = calibration_of_scene(path.parent_path() / e.calibration.substr(6), e.method);
            made[key] = fit(ctl::calibration_rows(of.scene, e.max_rows), of.request).calibration;
        } else if (made.count(key) == 0) {
            Problems problems;
            made[key] = load_calibration((path.parent_path() / e.calibration).string(), problems);
            problems.throw_if_any();
        }
        const Candidate candidate{made[key].model, e.method, e.method, made[key]};
        Lost lost;
        for (std::uint64_t seed = first; seed < first + count; ++seed)
            for (const sim::Sensor& sensor : original.sensors) {
                if (::fnmatch(e.sensor.c_str(), sensor.name.c_str(), 0) != 0) continue;
                sim::Scene scene = original;
                scene.seed = seed;
                scene.sensors = {sensor};
                add(candidate, scene, e, lost);
            }
        const auto cell = [&](bool has, std::size_t n, std::size_t of) {
            return has ? fmt::format("{:>8.2f}", percent(n, of)) : fmt::format("{:>8}", "none");
        };
        fmt::print("{:<60} {:>9} {:>6.1f} | {} | {:>6.2f} {:>6.2f}\n",
                   fmt::format("{} {}, {} {}", path.stem().string(), e.sensor, e.calibration, e.method), lost.samples,
                   percent(lost.good, lost.samples), cell(lost.has_monitor, lost.by_monitor, lost.good),
                   percent(lost.by_disagreement, lost.samples), lost.frozen);
        std::fflush(stdout);
    };
    for (const fs::path& path : scenes_in(folder, name))
        for (const Expectation& e : expectations_of(path)) judge(path, e);
    for (const Contested& each : contested())
        for (const char* const method : each.methods)
            for (const char* const kind : {"easy", "combined", "eccentric", "dynamic"}) {
                const std::string stem = fmt::format("{}_{}", each.scenes, kind);
                if (!name.empty() && ::fnmatch(name.c_str(), stem.c_str(), 0) != 0) continue;
                judge(fs::path(folder) / (stem + ".toml"),
                      {"*", fmt::format("scene:{}.toml", each.calibration), method, 0, 1e9, kRowsOfContest});
            }
    for (const char* const kind :
         {"tradeoff_piezo_easy", "tradeoff_piezo_combined", "tradeoff_piezo_eccentric", "square_wave"})
        if (name.empty() || ::fnmatch(name.c_str(), kind, 0) == 0)
            judge(fs::path(folder) / fmt::format("{}.toml", kind), {"*", "scene:calibrate_piezo.toml", "fused", 0, 1e9});
}

}  // namespace tactiled
