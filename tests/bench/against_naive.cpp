// Compares the product's methods with the code that a user would write from the paper or a textbook (naive/*.hpp):
// the same calibrations and the same readings in one process, alternating. Prints a Markdown table: largest
// difference of the force, and the product's median time relative to the naive code's.
//
//   against_naive [samples]
//   against_naive --save FOLDER                               the calibrations and readings, for:
//   against_naive --count FOLDER MODEL/METHOD ours|naive N    N samples of one, to be counted: naive_instructions.py
//
// Only readings inside the calibrated domain that the product calls GOOD are compared: there both solve the same
// equations. The product does more: quality, standard deviation, missing, saturated and dead channels, the domain;
// `map` also checks whether another point explains the readings as well. Differences are relative to full scale.
// Methods that are a formula of a line or two (hair, ratio, curves) have no naive counterpart here.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "config/text_file.hpp"
#include "naive/corrections.hpp"
#include "naive/searches.hpp"
#include "node/lab/tradeoff.hpp"
#include "tactiled/reader.hpp"

namespace {

using namespace tactiled;
using namespace tactiled::ctl;
using Naive = std::function<Wrench(const std::vector<double>&)>;

struct Rival {
    std::string model, method, trial, naive;  // naive: description of the naive code
    Naive (*make)(const Calibration&);
};
template <class T>
Naive make(const Calibration& calibration) {
    return T(calibration);
}

const std::vector<Rival>& rivals() {
    static const std::vector<Rival> all{
        {"table", "linear", "combined", "pinv (SVD) at each sample", make<naive::PseudoInverse>},
        {"table", "matrix", "combined", "pinv (SVD) at each sample", make<naive::PseudoInverse>},
        {"table", "map", "eccentric", "Ceres problem at each sample, on from the last", make<naive::PointSearch>},
        {"capacitive", "overlap", "combined", "Ceres problem at each sample", make<naive::OverlapSearch>},
        {"generic", "matrix", "combined", "Eigen, dynamic", make<naive::Affine>},
        {"generic", "quadratic", "combined", "std::vector of features", make<naive::Corrected>},
        {"generic", "rbf", "combined", "std::vector of vectors", make<naive::Corrected>},
        {"generic", "mlp", "combined", "std::vector of vectors", make<naive::Corrected>},
    };
    return all;
}

struct Match {
    const Rival* rival;
    Calibration calibration;
    std::unique_ptr<Decoupler> ours;
    Naive naive;
    std::vector<double> storage;
    std::vector<Reading> readings;  // under load, inside the domain

    Reading reading(std::size_t i) const { return readings[i % readings.size()]; }
    std::vector<double> channels(std::size_t i) const {
        const auto& channel = readings[i % readings.size()].channel;
        return {channel.begin(), channel.end()};
    }
};

Match match_of(const Rival& rival, const Candidate& candidate, const Labelled& rows) {
    Match match{&rival, candidate.calibration, candidate.make(), rival.make(candidate.calibration), {}, {}};
    const auto all = readings_of(candidate, rows, match.storage);
    for (std::size_t i = first_load(rows); i < all.size(); ++i) {
        bool inside = all[i].missing == 0;
        for (std::size_t k = 0; k < all[i].channel.size(); ++k)
            inside = inside && all[i].channel[k] >= candidate.calibration.channel_least[k] &&
                     all[i].channel[k] <= candidate.calibration.channel_most[k];
        if (inside) match.readings.push_back(all[i]);
    }
    if (match.readings.empty()) throw std::runtime_error(rival.model + "/" + rival.method + ": no readings");
    return match;
}

// Calls `use` with each counterpart, the product's candidate and the rows of its trial.
template <class Use>
void each(const std::vector<Contest>& contests, Use use) {
    for (const Rival& rival : rivals())
        for (const Contest& contest : contests)
            for (const Candidate& candidate : contest.candidates)
                for (const Trial& trial : contest.trials)
                    if (contest.model == rival.model && candidate.name == rival.method && trial.kind == rival.trial)
                        use(rival, candidate, trial.rows);
}

std::string file(const std::string& folder, const Rival& rival, const char* ending) {
    return fmt::format("{}/{}-{}.{}", folder, rival.model, rival.method, ending);
}

void save(const std::string& folder, const Rival& rival, const Candidate& candidate, const Labelled& rows) {
    save_calibration(candidate.calibration, file(folder, rival, "toml"));
    std::string text = fmt::format("t_s,{},fx_N,fy_N,fz_N\n", fmt::join(rows.channels, ","));
    for (const LabelledRow& row : rows.rows)
        if (std::none_of(row.channel.begin(), row.channel.end(), [](double v) { return std::isnan(v); }))
            text += fmt::format("{},{},{},{},{}\n", double(row.t_ns) * 1e-9, fmt::join(row.channel, ","), row.wrench_S[0],
                                row.wrench_S[1], row.wrench_S[2]);
    replace_file(file(folder, rival, "csv"), text);
}

double sum = 0;  // keeps the optimiser from removing the loop
void one(Match& match, bool ours, std::size_t i) {
    if (ours)
        sum += match.ours->decouple(match.reading(i)).wrench_S[2];
    else
        sum += match.naive(match.channels(i))[2];
}

double median(std::vector<double>& values) {
    std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(values.size() / 2), values.end());
    return values[values.size() / 2];
}

void print_row(Match& match, std::size_t samples) {
    std::vector<double> differences, ours_ns, naive_ns;
    const double full_scale =
        *std::max_element(match.calibration.full_scale.begin(), match.calibration.full_scale.begin() + 3);
    for (std::size_t i = 0; i < match.readings.size(); ++i) {
        const Estimate ours = match.ours->decouple(match.reading(i));
        const Wrench naive = match.naive(match.channels(i));
        if (ours.quality() != TACTILED_GOOD) continue;
        double largest = 0;
        for (std::size_t c = 0; c < 3; ++c) largest = std::max(largest, std::abs(ours.wrench_S[c] - naive[c]));
        differences.push_back(largest / full_scale);
    }
    constexpr std::size_t kTurn = 64;
    for (std::size_t done = 0; done < samples; done += kTurn)
        for (const bool ours : {true, false})
            for (std::size_t i = done; i < done + kTurn; ++i) {
                const std::uint64_t began = monotonic_ns();
                one(match, ours, i);
                (ours ? ours_ns : naive_ns).push_back(double(monotonic_ns() - began) - clock_ns());
            }
    std::sort(differences.begin(), differences.end());
    const auto share = double(std::count_if(differences.begin(), differences.end(), [](double d) { return d < 1e-4; })) /
                       double(differences.size());
    fmt::print("| {}/{} | {} | {} | {:.1e} | {:.1e} | {:.1f} % | {:.0f} | {:.0f} | {:.1f} |\n", match.rival->model,
               match.rival->method, match.rival->naive, differences.size(), differences[differences.size() / 2],
               differences.back(), 100 * share, median(ours_ns), median(naive_ns), median(naive_ns) / median(ours_ns));
}

}  // namespace

int main(int argc, char** argv) {
    const std::vector<std::string> words(argv + 1, argv + argc);
    if (words.size() == 5 && words[0] == "--count") {
        for (const Rival& rival : rivals()) {
            if (rival.model + "/" + rival.method != words[2]) continue;
            const Contest contest = contest_of_calibration(file(words[1], rival, "toml"));
            Match match = match_of(rival, contest.candidates.front(), read_labelled(file(words[1], rival, "csv"), {}));
            for (std::size_t i = 0; i < std::stoul(words[4]); ++i) one(match, words[3] == "ours", i);
            return sum == 1 ? 1 : 0;
        }
        return 1;
    }
    const bool counted = words.size() == 1 && words[0].find_first_not_of("0123456789") == std::string::npos;
    if (!words.empty() && !counted && !(words.size() == 2 && words[0] == "--save")) {
        fmt::print(stderr, "against_naive [SAMPLES] | --save FOLDER | --count FOLDER MODEL/METHOD ours|naive N\n");
        return 2;
    }
    const std::vector<Contest> contests = all_contests(scenes_folder(), [](double) {});
    if (words.size() == 2 && words[0] == "--save") {
        each(contests, [&](const Rival& rival, const Candidate& candidate, const Labelled& rows) {
            save(words[1], rival, candidate, rows);
        });
        return 0;
    }
    const std::size_t samples = words.empty() ? 20'000 : std::stoul(words[0]);
    fmt::print(
        "| method | naive | readings | difference, median | largest | within 1e-4 | ours, ns | naive, ns | times |\n");
    fmt::print("|---|---|---|---|---|---|---|---|---|\n");
    each(contests, [&](const Rival& rival, const Candidate& candidate, const Labelled& rows) {
        Match match = match_of(rival, candidate, rows);
        print_row(match, samples);
    });
    return sum == 1 ? 1 : 0;
}
