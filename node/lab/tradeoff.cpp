// tactilectl tradeoff: measures time and accuracy of the methods on this machine.
#include "node/lab/tradeoff.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "config/text_file.hpp"
#include "node/ctl/command_line.hpp"
#include "node/lab/output.hpp"
#include "node/lab/progress.hpp"

namespace tactiled::ctl {
namespace {

constexpr std::size_t kSamples = 16'384;  // for each method in each scene: 16 beyond p99.9

struct Args {
    std::string calibration, scene, in, scenes, csv, svg;
    bool json = false;  // JSON on standard output, instead of the table
    std::size_t samples = kSamples;
};

double mean_of(const std::vector<double>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

Measure measure_of(const std::string& trial, const Judged& judged, std::vector<float>& ns, double instructions) {
    return {trial, judged, quantile(ns, 0.5), quantile(ns, 0.99), quantile(ns, 0.999), instructions, false};
}

std::vector<Offer> offers_of(const Result& result, std::size_t column) {
    std::vector<Offer> offers;
    for (std::size_t i = 0; i < result.measures.size(); ++i) {
        const Measure& m = result.measures[i][column];
        const double bad_percent = 100 * double(m.judged.bad) / double(std::max<std::size_t>(m.judged.samples, 1));
        offers.push_back({result.contest->candidates[i].name, m.p50_ns / 1e3, m.judged.force_rms_percent, bad_percent});
    }
    return offers;
}

Result compete(const Contest& contest, std::size_t samples, const std::function<void(double)>& show) {
    Result result{&contest, std::vector<std::vector<Measure>>(contest.candidates.size()), ""};
    std::vector<Timing> all(contest.candidates.size());
    std::vector<std::vector<double>> instructions(contest.candidates.size());
    std::vector<std::vector<Judged>> whole(contest.candidates.size());
    for (std::size_t t = 0; t < contest.trials.size(); ++t) {
        const Trial& trial = contest.trials[t];
        std::vector<Timing> timings = time_all(contest.candidates, trial.rows, samples);
        for (std::size_t i = 0; i < timings.size(); ++i) {
            const auto decoupler = contest.candidates[i].make();
            const Judged judged = judge(*decoupler, contest.candidates[i], trial.rows, trial.delay_s);
            result.measures[i].push_back(measure_of(trial.kind, judged, timings[i].ns, timings[i].instructions));
            if (trial.kind == kDamaged) continue;
            all[i].ns.insert(all[i].ns.end(), timings[i].ns.begin(), timings[i].ns.end());
            whole[i].push_back(judged);
            instructions[i].push_back(timings[i].instructions);
        }
        show(double(t + 1) / double(contest.trials.size()));
    }
    for (std::size_t i = 0; i < all.size(); ++i)
        result.measures[i].push_back(measure_of("all", over_all(whole[i]), all[i].ns, mean_of(instructions[i])));
    for (std::size_t column = 0; column <= contest.trials.size(); ++column)
        for (const std::size_t i : front(offers_of(result, column))) result.measures[i][column].on_front = true;
    result.sentence = front_sentence(contest.model, offers_of(result, contest.trials.size()));
    return result;
}

std::vector<Contest> contests_of(const Args& args, const std::function<void(double)>& show) {
    const auto folder = [&] { return args.scenes.empty() ? scenes_folder() : args.scenes; };
    if (args.calibration.empty() && args.scene.empty()) return all_contests(folder(), show);
    Contest contest =
        args.calibration.empty() ? contest_of_scene(folder(), args.scene) : contest_of_calibration(args.calibration);
    if (!args.scene.empty())
        contest.trials.push_back(trial_of(std::filesystem::path(args.scene).stem().string(), args.scene));
    if (!args.in.empty()) {
        Selection selection;
        if (!contest.candidates.empty()) selection.channels = contest.candidates.front().calibration.channels;
        contest.trials.push_back({std::filesystem::path(args.in).stem().string(), read_labelled(args.in, selection)});
    }
    if (contest.candidates.empty())
        throw std::runtime_error(contest.refused.empty() ? "no method to compare" : contest.refused.front());
    std::vector<Contest> one;
    one.push_back(std::move(contest));
    return one;
}

int tradeoff(const Args& args) {
    for (const auto& path : {args.csv, args.svg})
        if (!path.empty()) check_output(path);
    if (!args.calibration.empty() && args.scene.empty() && args.in.empty())
        throw SetupError("--calibration: over what? Name a scene with --scene, or labelled readings with --in");
    if (!args.in.empty() && args.calibration.empty())
        throw SetupError("--in: which methods? Name a calibration with --calibration");
    Progress progress("tradeoff");
    // Calibrating takes the largest part of the time.
    const std::vector<Contest> contests = contests_of(args, [&](double share) { progress.show(0.7 * share); });
    std::vector<Result> results;
    for (const Contest& contest : contests) {
        const double begun = double(results.size());
        results.push_back(compete(contest, args.samples, [&](double share) {
            progress.show(0.7 + 0.3 * (begun + share) / double(contests.size()));
        }));
    }
    if (!args.csv.empty()) replace_file(args.csv, tradeoff_csv(results));
    if (!args.svg.empty()) replace_file(args.svg, tradeoff_svg(results));
    fmt::print("{}", args.json ? tradeoff_json(results) : tradeoff_text(results));
    return kGood;
}

}  // namespace

Run add_tradeoff(Command verb) {
    auto args = std::make_shared<Args>();
    verb.add_option("--calibration", args->calibration,
                    "instead: all methods of this calibration file, over --scene or --in");
    verb.add_option("--scene", args->scene,
                    "this scene instead of the named ones; without --calibration its sensor is calibrated in simulation");
    verb.add_option("--in", args->in, "labelled.csv: your own readings, with --calibration");
    verb.add_option("--scenes", args->scenes, "the folder of the named scenes, if it is not beside the program");
    verb.add_option("--csv", args->csv, "write the table as CSV: a row a method and scene");
    verb.add_option("--svg", args->svg, "write the figure as SVG");
    verb.add_option("--samples", args->samples, "to time, of each thing that is compared")
        .integer_in(std::size_t(1), std::size_t(100'000'000));
    verb.add_flag("--json", args->json, "print the table as JSON");
    return [args] { return tradeoff(*args); };
}

}  // namespace tactiled::ctl
