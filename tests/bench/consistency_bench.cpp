// Is GOOD consistent, and the stated uncertainty true? Every method of every model, calibrated in simulation as in
// `tactilectl tradeoff`, through the Decoupler and the latency of the loop.
//
//   consistency_bench coverage [MODEL]             each scene: share within 1 sd, beyond 5 sd (and of them, in % of GOOD,
//                                                  those off from every load during the measurement, too: not only late),
//                                                  median sd / rms, the same without the part of latency, share within the
//                                                  true rms of the scene, median sd with latency over that without: ours,
//                                                  and of an oracle that knows the load; the oracle's beyond 5 sd
//   consistency_bench costs [MODEL]                ns per sample of the monitor and of latency
//   consistency_bench scenes [NAME]                the same for the scenes with an [[expect]]
//   consistency_bench damaged FIRST COUNT [MODEL]  the damaged scenes with COUNT seeds from FIRST on: GOOD and beyond 5 sd,
//                                                  with the detection of frozen channels, and without
//   consistency_bench alarms HOURS [MODEL]         use with a load that wanders, other loads and noise than the
//   calibration's,
//                                                  and with each of these held away; calibrations of 1 to 5 sessions. The
//                                                  environment's USE="as in use" chooses one of them
//   consistency_bench parts FIRST COUNT [SCENE]    the scenes on COUNT sensors, each calibrated by itself: terms of the
//   variance,
//                                                  and sharpness beside that of oracles that know the errors in use
//                                                  (the environment's RESTS=1: calibrated in use with rests; RESTS=also:
//                                                  in the scene's recording and then in use with rests; SETTLED=1: samples
//                                                  under a load that moves are left out)
//   consistency_bench lost FIRST COUNT [SCENE]     the undamaged scenes: GOOD samples that each check costs
//   consistency_bench damage FIT.csv JUDGE.csv     a recording: one channel after the other damaged while the rows of JUDGE
//                                                  run; GOOD, and GOOD and off by more than 10 % of full scale, or by 5 sd;
//                                                  in some component; ns of the checks
//
// Only "damaged" and "lost" look for frozen channels, which the node does before the model.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <string>
#include <vector>

#include "consistency.hpp"
#include "decoupling/fit/fit.hpp"
#include "node/lab/tradeoff.hpp"

namespace {

using namespace tactiled;
using namespace tactiled::ctl;

void coverage(const std::vector<Contest>& contests) {
    print_titles("method, scene");
    for (const Contest& contest : contests)
        for (const Candidate& candidate : contest.candidates)
            for (const Trial& trial : contest.trials) {
                Course course(candidate, trial.rows, trial.delay_s);
                course.judge(trial.rows);
                print_shares(fmt::format("{}/{} {}", contest.model, candidate.name, trial.kind), course.shares());
            }
}

void damaged(const std::string& folder, const std::vector<Contest>& contests, std::uint64_t first, std::uint64_t count) {
    for (const Contest& contest : contests) {
        const std::string of = contest.model == "generic" ? "capacitive" : contest.model;
        const std::vector<Candidate>& candidates = contest.candidates;
        std::vector<std::vector<double>> undetected(candidates.size()), without_detection(candidates.size());
        std::vector<double> good(candidates.size());
        for (std::uint64_t seed = first; seed < first + count; ++seed) {
            sim::Scene scene = sim::read_scene(fmt::format("{}/tradeoff_{}_damaged.toml", folder, of));
            scene.seed = seed;
            const Labelled rows = rows_of(scene, kMaxOfScene);
            const auto shares_of = [&](const Candidate& candidate, const std::vector<bool>& only) {
                Course course(candidate, rows, scene.delay_s(scene.sensors.front()));
                course.judge(rows, 0, 1e9, only);
                return course.shares();
            };
            for (std::size_t i = 0; i < candidates.size(); ++i) {
                const Shares all = shares_of(candidates[i], {});
                std::vector<bool> not_frozen = is_frozen(candidates[i], rows);
                not_frozen.flip();
                without_detection[i].push_back(percent(all.undetected, all.samples));
                undetected[i].push_back(percent(shares_of(candidates[i], not_frozen).undetected, all.samples));
                good[i] += percent(all.good, all.samples) / double(count);
            }
        }
        const auto print = [&](const std::vector<double>& of_seeds) {
            const auto worst = std::max_element(of_seeds.begin(), of_seeds.end());
            fmt::print("mean {:>6.2f} %, worst {:>6.2f} % (seed {})",
                       std::accumulate(of_seeds.begin(), of_seeds.end(), 0.0) / double(count), *worst,
                       first + std::uint64_t(worst - of_seeds.begin()));
        };
        for (std::size_t i = 0; i < candidates.size(); ++i) {
            fmt::print("{:<34} undetected ", contest.model + "/" + candidates[i].name);
            print(undetected[i]);
            fmt::print(", without the detection of frozen channels ");
            print(without_detection[i]);
            fmt::print(", GOOD without it {:>5.1f} %\n", good[i]);
        }
    }
}

}  // namespace

int main(int argc, char** argv) {
    const std::string what = argc > 1 ? argv[1] : "";
    const int numbers = what == "damaged" || what == "damage" || what == "parts" || what == "lost" ? 2
                        : what == "alarms"                                                         ? 1
                        : what == "coverage" || what == "costs" || what == "scenes"                ? 0
                                                                                                   : -1;
    if (numbers < 0 || argc < 2 + numbers) {
        fmt::print(stderr,
                   "usage: consistency_bench coverage|costs|scenes|damaged FIRST COUNT|alarms HOURS [MODEL]\n"
                   "       consistency_bench parts|lost FIRST COUNT [SCENE]\n"
                   "       consistency_bench damage FIT.csv JUDGE.csv [METHODS]\n");
        return 2;
    }
    try {
        const std::string folder = scenes_folder(), model = argc > 2 + numbers ? argv[2 + numbers] : "";
        if (what == "damage") {
            judge_damage(argv[2], argv[3], model);
            return 0;
        }
        if (what == "parts") {
            judge_parts(folder, std::strtoull(argv[2], nullptr, 10), std::strtoull(argv[3], nullptr, 10), model);
            return 0;
        }
        if (what == "lost") {
            judge_lost(folder, std::strtoull(argv[2], nullptr, 10), std::strtoull(argv[3], nullptr, 10), model);
            return 0;
        }
        if (what == "scenes") {
            judge_scenes(folder, model);
            return 0;
        }
        const std::vector<Contest> contests = all_contests(
            folder, [](double) {}, model);
        if (what == "coverage") coverage(contests);
        if (what == "costs") print_costs(contests);
        if (what == "damaged")
            damaged(folder, contests, std::strtoull(argv[2], nullptr, 10), std::strtoull(argv[3], nullptr, 10));
        if (what == "alarms") judge_ensemble(folder, contests, std::strtod(argv[2], nullptr));
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
