// Is GOOD consistent, and the stated uncertainty true? Every method of every model, calibrated in simulation as in
// `tactilectl tradeoff`, through the Decoupler and the latency of the loop.
//
//   consistency_bench coverage [MODEL]             each scene: share within 1 sd, beyond 5 sd (and of them, in % of GOOD,
//                                                  those off from every load during the measurement, too: not only late),
//                                                  median sd / rms, share within the true rms of the scene, median sd
//                                                  with that of latency over that without
//   consistency_bench costs [MODEL]                ns per sample of parity, joint domain and latency
//   consistency_bench scenes [NAME]                the same for the scenes with an [[expect]], and without parity
//   consistency_bench damaged FIRST COUNT [MODEL]  the damaged scenes with COUNT seeds from FIRST on: GOOD and beyond 5 sd
//   consistency_bench alarms HOURS [MODEL]         clean use with a load that wanders: samples that are not GOOD, by reason
//   consistency_bench damage FIT.csv JUDGE.csv     a recording: one channel after the other damaged while the rows of JUDGE
//                                                  run; GOOD, and GOOD and off by more than 10 % of full scale, or by 5 sd;
//                                                  with parity if the environment has PARITY; ns of the checks
//
// Frozen channels are not looked for: that is the node's, before the model.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "consistency.hpp"
#include "decoupling/fit/fit.hpp"
#include "node/lab/tradeoff.hpp"

namespace {

namespace fs = std::filesystem;
using namespace tactiled;
using namespace tactiled::ctl;

void coverage(const std::vector<Contest>& contests) {
    fmt::print("{:<30} {:>10} {:>9} {:>8} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n", "method, scene", "GOOD %",
               "no parity", "in 1 sd", "over 5 sd", "not late", "sd / rms", "together", "in 1 rms", "latency", "samples");
    for (const Contest& contest : contests)
        for (const Candidate& candidate : contest.candidates)
            for (const Trial& trial : contest.trials) {
                Course course(candidate, trial.delay_s);
                course.judge(trial.rows);
                Candidate without = candidate;
                without.calibration.parity = {};
                Course other(without, trial.delay_s);
                other.judge(trial.rows);
                const Shares s = course.shares(), o = other.shares();
                fmt::print(
                    "{:<30} {:>10.2f} {:>9.2f} {:>8.1f} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.1f} {:>9.2f} {:>9}\n",
                    fmt::format("{}/{} {}", contest.model, candidate.name, trial.kind), percent(s.good, s.samples),
                    percent(o.good, o.samples), percent(s.within, s.values), percent(s.undetected, s.good),
                    percent(s.wrong, s.good), s.sharpness, s.sharpness_together, percent(s.within_true, s.values), s.latency,
                    s.samples);
                std::fflush(stdout);
            }
}

void damaged(const std::string& folder, const std::vector<Contest>& contests, std::uint64_t first, std::uint64_t count) {
    for (const Contest& contest : contests) {
        const std::string of = contest.model == "generic" ? "capacitive" : contest.model;
        std::vector<Candidate> candidates = contest.candidates;
        for (const Candidate& candidate : contest.candidates) {
            candidates.push_back(candidate);
            candidates.back().name += ", no parity";
            candidates.back().calibration.parity = {};
        }
        std::vector<std::vector<double>> undetected(candidates.size());
        std::vector<double> good(candidates.size());
        for (std::uint64_t seed = first; seed < first + count; ++seed) {
            sim::Scene scene = sim::read_scene(fmt::format("{}/tradeoff_{}_damaged.toml", folder, of));
            scene.seed = seed;
            const Labelled rows = rows_of(scene, kMaxOfScene);
            for (std::size_t i = 0; i < candidates.size(); ++i) {
                Course course(candidates[i], scene.delay_s(scene.sensors.front()));
                course.judge(rows);
                const Shares s = course.shares();
                undetected[i].push_back(percent(s.undetected, s.samples));
                good[i] += percent(s.good, s.samples) / double(count);
            }
        }
        for (std::size_t i = 0; i < candidates.size(); ++i) {
            double mean = 0;
            for (const double each : undetected[i]) mean += each / double(count);
            const auto worst = std::max_element(undetected[i].begin(), undetected[i].end());
            fmt::print("{:<34} undetected mean {:>6.2f} %, worst {:>6.2f} % (seed {}), GOOD {:>5.1f} %\n",
                       contest.model + "/" + candidates[i].name, mean, *worst,
                       first + std::uint64_t(worst - undetected[i].begin()), good[i]);
        }
    }
}

// The scene, with its loads wandering from another seed: a copy beside a link to the calibrations that it names.
CalibrationScene with_other_loads(const std::string& path, const fs::path& copies, std::uint64_t seed) {
    std::ifstream in(path);
    std::string text{std::istreambuf_iterator<char>(in), {}};
    const std::string wander = "do = \"wander\"\n";
    const auto at = text.find(wander);
    if (at == text.npos) throw std::runtime_error(path + ": no load wanders");
    text.insert(at + wander.size(), fmt::format("seed = {}\n", seed));
    std::ofstream(copies / "scenes" / "copy.toml") << text;
    CalibrationScene scene = read_calibration_scene(copies / "scenes" / "copy.toml");
    scene.scene.seed = seed;
    return scene;
}

// The calibration's kind of use goes on for hours, with other loads and other noise.
void alarms(const std::string& folder, const std::vector<Contest>& contests, double hours) {
    const std::map<std::string, std::string> scenes{{"table", "tradeoff_table_calibrate"},
                                                    {"hair", "tradeoff_hair_calibrate"},
                                                    {"capacitive", "tradeoff_capacitive_calibrate"},
                                                    {"generic", "tradeoff_generic_calibrate"}};
    const fs::path copies = fs::temp_directory_path() / fmt::format("consistency_bench.{}", ::getpid());
    fs::create_directories(copies / "scenes");
    fs::create_directory_symlink(fs::path(folder).parent_path() / "calibration", copies / "calibration");
    for (const Contest& contest : contests) {
        const auto found = scenes.find(contest.model);
        if (found == scenes.end()) continue;
        const std::string path = folder + "/" + found->second + ".toml";
        const CalibrationScene first = read_calibration_scene(path);
        std::vector<Course> courses;
        for (const Candidate& candidate : contest.candidates)
            courses.emplace_back(candidate, first.scene.delay_s(first.scene.sensors.front()));
        double done_s = 0;
        for (std::uint64_t seed = 5000; done_s < hours * 3600; ++seed) {
            const CalibrationScene source = with_other_loads(path, copies, seed);
            const Labelled rows = rows_of(source.scene, std::size_t(source.scene.samples));
            done_s += double(source.scene.samples) / source.scene.rate_Hz;
            for (Course& course : courses) {
                course.mount_again();
                course.judge(rows);
            }
        }
        for (std::size_t i = 0; i < courses.size(); ++i) {
            const Shares s = courses[i].shares();
            fmt::print(
                "{:<24} {:.1f} h, {} samples, GOOD {:.4f} %, in 1 sd {:.1f} %, over 5 sd {:.2f} %, not late {:.2f} %, sd / "
                "rms {:.2f}",
                contest.model + "/" + contest.candidates[i].name, done_s / 3600, s.samples, percent(s.good, s.samples),
                percent(s.within, s.values), percent(s.undetected, s.good), percent(s.wrong, s.good), s.sharpness_together);
            for (const auto& [reasons, n] : s.reasons)
                if (reasons != 0) fmt::print(", reasons 0x{:x}: {:.4f} %", reasons, percent(n, s.samples));
            fmt::print("\n");
        }
    }
    fs::remove_all(copies);
}

using Damage = std::function<void(std::vector<double>&, std::size_t)>;

// Each channel in turn, damaged in all rows. `damage` is given the row and the channel.
void judge_damage(const Calibration& calibration, const std::string& kind, const Labelled& rows, std::size_t cases,
                  const Damage& damage) {
    std::size_t samples = 0, good = 0, wrong = 0, beyond = 0;
    double worst = 0;
    for (std::size_t k = 0; k < cases; ++k) {
        const auto decoupler = make_decoupler(calibration);
        for (const LabelledRow& row : rows.rows) {
            std::vector<double> channel = row.channel;
            damage(channel, k);
            const Estimate e = decoupler->decouple({.channel = channel, .t_ns = row.t_ns});
            ++samples;
            if (e.quality != TACTILED_GOOD) continue;
            ++good;
            bool is_wrong = false, is_beyond = false;
            for (std::size_t i = 0; i < calibration.components.size(); ++i) {
                const std::size_t c = component_index(calibration.components[i]);
                const double error = std::abs(e.wrench_S[c] - row.wrench_S[c]);
                if (!std::isfinite(error)) continue;
                is_wrong = is_wrong || error > 0.1 * calibration.full_scale[i];
                is_beyond = is_beyond || error > 5 * e.sd[c];
                worst = std::max(worst, error / calibration.full_scale[i]);
            }
            wrong += is_wrong;
            beyond += is_beyond;
        }
    }
    fmt::print("{:<10} {:<16} GOOD {:>6.2f} %  wrong {:>5.2f} %  beyond 5 sd {:>5.2f} %  worst {:>5.1f} %\n",
               calibration.method, kind, percent(good, samples), percent(wrong, samples), percent(beyond, samples),
               100 * worst);
    std::fflush(stdout);
}

// The damages of damaged_channels.py.
void damage(const std::string& fit_file, const std::string& judge_file, const std::string& methods) {
    const Labelled seen = read_labelled(fit_file, {}), unseen = read_labelled(judge_file, {});
    std::vector<double> least = seen.rows.front().channel, most = least;
    const LabelledRow* rest = &seen.rows.front();
    for (const LabelledRow& row : seen.rows) {
        const auto load = [](const LabelledRow& r) {
            double sum = 0;
            for (const double f : r.wrench_S) sum += std::isfinite(f) ? std::abs(f) : 0;
            return sum;
        };
        if (load(row) < load(*rest)) rest = &row;
        for (std::size_t k = 0; k < least.size(); ++k) {
            least[k] = std::min(least[k], row.channel[k]);
            most[k] = std::max(most[k], row.channel[k]);
        }
    }
    const std::size_t n = seen.channels.size();
    std::mt19937 random(3);
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    while (pairs.size() < 40)
        if (const auto a = random() % n, b = random() % n; a != b) pairs.emplace_back(a, b);
    const std::vector<std::pair<const char*, Damage>> kinds{
        {"undamaged", [](auto&, std::size_t) {}},
        {"at rest", [&](auto& channel, std::size_t k) { channel[k] = rest->channel[k]; }},
        {"at zero", [](auto& channel, std::size_t k) { channel[k] = 0; }},
        {"half gain", [](auto& channel, std::size_t k) { channel[k] *= 0.5; }},
        {"turned round", [](auto& channel, std::size_t k) { channel[k] *= -1; }},
        {"shifted by 20 %", [&](auto& channel, std::size_t k) { channel[k] += 0.2 * (most[k] - least[k]); }},
        {"exchanged", [&](auto& channel, std::size_t k) { std::swap(channel[pairs[k].first], channel[pairs[k].second]); }}};
    std::stringstream names(methods.empty() ? "matrix,quadratic,rbf,mlp" : methods);
    for (std::string method; std::getline(names, method, ',');) {
        const FitReport report = fit(
            seen,
            {.model = "generic", .method = method, .serial = "", .date = "", .parity = std::getenv("PARITY") != nullptr});
        const Calibration& calibration = report.calibration;
        for (const std::string& warning : report.warnings) fmt::print("{}: {}\n", method, warning);
        fmt::print("{}: sd of unloading, of full scale:", method);
        for (std::size_t i = 0; i < calibration.sd_unloading.size(); ++i)
            fmt::print(" {:.4f} beside {:.4f}", calibration.sd_unloading[i] / calibration.full_scale[i],
                       calibration.sd[i] / calibration.full_scale[i]);
        fmt::print("\n");
        fmt::print(
            "{}: {} channels checked by the others\n", method,
            std::count_if(calibration.parity.sd.begin(), calibration.parity.sd.end(), [](double sd) { return sd > 0; }));
        print_costs({{.model = "generic",
                      .candidates = {{"generic", method, method, calibration}},
                      .trials = {{"judged", unseen, 0}},
                      .refused = {}}});
        for (const auto& [kind, how] : kinds)
            judge_damage(calibration, kind, unseen,
                         std::string(kind) == "undamaged"   ? 1
                         : std::string(kind) == "exchanged" ? pairs.size()
                                                            : n,
                         how);
    }
}

}  // namespace

int main(int argc, char** argv) {
    const std::string what = argc > 1 ? argv[1] : "";
    const int numbers = what == "damaged" || what == "damage"                       ? 2
                        : what == "alarms"                                          ? 1
                        : what == "coverage" || what == "costs" || what == "scenes" ? 0
                                                                                    : -1;
    if (numbers < 0 || argc < 2 + numbers) {
        fmt::print(stderr,
                   "usage: consistency_bench coverage|costs|scenes|damaged FIRST COUNT|alarms HOURS [MODEL]\n"
                   "       consistency_bench damage FIT.csv JUDGE.csv [METHODS]\n");
        return 2;
    }
    try {
        const std::string folder = scenes_folder(), model = argc > 2 + numbers ? argv[2 + numbers] : "";
        if (what == "damage") {
            damage(argv[2], argv[3], model);
            return 0;
        }
        if (what == "scenes") {
            judge_scenes(folder, model);
            return 0;
        }
        const std::vector<Contest> contests = all_contests(
            folder, [](double) {}, model, true);
        if (what == "coverage") coverage(contests);
        if (what == "costs") print_costs(contests);
        if (what == "damaged")
            damaged(folder, contests, std::strtoull(argv[2], nullptr, 10), std::strtoull(argv[3], nullptr, 10));
        if (what == "alarms") alarms(folder, contests, std::strtod(argv[2], nullptr));
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
