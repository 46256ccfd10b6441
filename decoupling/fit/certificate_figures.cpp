// The figures of ISO 376 from the holds of a recording; certificate.hpp has the equations.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "decoupling/fit/certificate.hpp"
#include "decoupling/fit/groups.hpp"
#include "decoupling/unloading.hpp"

namespace tactiled {
namespace {

constexpr double kCreepFrom_s = 30, kCreepTo_s = 300;  // the creep test of ISO 376:2011

// A hold of one component after a rest: the deviation is less that of the rest.
struct Visit {
    std::size_t zero, session;
    double load, deviation;
    int direction;
};
using Visits = std::vector<Visit>;

struct Level {
    Wrench load;  // its first hold has it
    Visits visits;
};

// Returns the loads of component c that were held after a rest, each with its holds in the order of the file.
std::vector<Level> levels_of(const LoadedRows& loaded, std::size_t c) {
    std::vector<Level> levels;
    for (const Hold& hold : loaded.holds) {
        if (hold.zero == Hold::kNone || !(std::abs(hold.load[c]) > LoadPeak::kRest * loaded.full_scale[c])) continue;
        const double deviation = hold.deviation[c] - loaded.holds[hold.zero].deviation[c];
        if (!std::isfinite(deviation)) continue;
        auto level = std::find_if(levels.begin(), levels.end(),
                                  [&](const Level& other) { return loaded.is_same_load(other.load, hold.load); });
        if (level == levels.end()) level = levels.insert(level, Level{.load = hold.load, .visits = {}});
        level->visits.push_back({hold.zero, hold.session, hold.load[c], deviation, loaded.direction(hold, c)});
    }
    return levels;
}

double mean_load(const Visits& visits) {
    double sum = 0;
    for (const Visit& visit : visits) sum += visit.load;
    return sum / double(visits.size());
}

double relative_range(const Visits& visits) {
    const auto [least, most] = std::minmax_element(visits.begin(), visits.end(),
                                                   [](const Visit& a, const Visit& b) { return a.deviation < b.deviation; });
    return (most->deviation - least->deviation) / std::abs(mean_load(visits));
}

std::map<std::size_t, Visits> rising_by_session(const Level& level) {
    std::map<std::size_t, Visits> rising;
    for (const Visit& visit : level.visits)
        if (visit.direction > 0) rising[visit.session].push_back(visit);
    return rising;
}

void add(LoadFigure& figure, double load, double value) {
    figure.load.push_back(load);
    figure.value.push_back(value);
}

// Adds the interpolation, reproducibility and repeatability of one load.
void add_rising(const Level& level, LoadFigure& interpolation, LoadFigure& reproducibility, LoadFigure& repeatability,
                std::vector<Wrench>& loads) {
    Visits first;
    double largest = kNaN, at = kNaN;
    for (const auto& [session, visits] : rising_by_session(level)) {
        first.push_back(visits.front());
        if (visits.size() < 2 || relative_range(visits) <= largest) continue;
        largest = relative_range(visits);
        at = mean_load(visits);
    }
    if (first.empty()) return;
    double sum = 0;
    for (const Visit& visit : first) sum += visit.deviation;
    const double load = mean_load(first);
    add(interpolation, load, sum / double(first.size()) / load);
    loads.push_back(level.load);
    if (first.size() > 1) add(reproducibility, load, relative_range(first));
    if (std::isfinite(largest)) add(repeatability, at, largest);
}

// Adds the mean over the series in which this load was reached by rising and, after that, by falling.
void add_reversal(const Level& level, LoadFigure& reversibility) {
    std::map<std::size_t, Visits> of_series;
    for (const Visit& visit : level.visits) of_series[visit.zero].push_back(visit);
    Visits both;
    double sum = 0;
    for (const auto& [zero, visits] : of_series) {
        const auto rising =
            std::find_if(visits.begin(), visits.end(), [](const Visit& visit) { return visit.direction > 0; });
        const auto falling = std::find_if(visits.rbegin(), std::make_reverse_iterator(rising),
                                          [](const Visit& visit) { return visit.direction < 0; });
        if (rising == visits.end() || falling == std::make_reverse_iterator(rising)) continue;
        both.push_back(*rising);
        both.push_back(*falling);
        sum += std::abs(falling->deviation - rising->deviation);
    }
    if (both.empty()) return;
    const double load = mean_load(both);
    add(reversibility, load, sum / (double(both.size()) / 2) / std::abs(load));
}

LoadFigure zero_error(const LoadedRows& loaded, std::size_t c) {
    LoadFigure figure;
    double largest = 0;  // load of the series
    for (const Hold& hold : loaded.holds) {
        if (hold.zero == Hold::kNone) {
            largest = 0;
        } else if (!hold.is_rest) {
            if (std::abs(hold.load[c]) > std::abs(largest)) largest = hold.load[c];
        } else {
            const double change = hold.deviation[c] - loaded.holds[hold.zero].deviation[c];
            if (std::abs(largest) > LoadPeak::kRest * loaded.full_scale[c] && std::isfinite(change))
                add(figure, largest, change / loaded.full_scale[c]);
            largest = 0;
        }
    }
    return figure;
}

// Returns the deviation of the first GOOD row this long after the beginning of a hold, NaN if there is none.
double deviation_after(const LoadedRows& loaded, const Hold& hold, std::size_t c, double time_s) {
    const std::uint64_t at_ns = loaded.rows[hold.begin]->t_ns + std::uint64_t(std::llround(1e9 * time_s));
    for (std::size_t i = hold.begin; i < hold.end; ++i)
        if (loaded.rows[i]->t_ns >= at_ns && std::isfinite(loaded.deviation[i][c])) return loaded.deviation[i][c];
    return kNaN;
}

LoadFigure creep(const LoadedRows& loaded, std::size_t c) {
    const auto is_full = [&](const Hold& hold) { return std::abs(hold.load[c]) >= (1 - kSameLoad) * loaded.full_scale[c]; };
    LoadFigure figure;
    for (const Hold& hold : loaded.holds) {
        const bool follows = hold.is_rest && hold.before != Hold::kNone && is_full(loaded.holds[hold.before]);
        if (!is_full(hold) && !follows) continue;
        const double change = deviation_after(loaded, hold, c, kCreepTo_s) - deviation_after(loaded, hold, c, kCreepFrom_s);
        if (std::isfinite(change)) add(figure, hold.load[c], std::abs(change) / loaded.full_scale[c]);
    }
    return figure;
}

}  // namespace

std::array<LoadFigure, kFigureKinds.size()> iso376_figures(const LoadedRows& loaded, std::size_t c,
                                                           std::vector<Wrench>& loads) {
    std::array<LoadFigure, kFigureKinds.size()> figures;
    auto& [interpolation, reproducibility, repeatability, reversibility, zero, of_creep] = figures;
    const std::vector<Level> levels = levels_of(loaded, c);
    for (const Level& level : levels) {
        add_rising(level, interpolation, reproducibility, repeatability, loads);
        add_reversal(level, reversibility);
    }
    zero = zero_error(loaded, c);
    of_creep = creep(loaded, c);
    const std::array<const char*, kFigureKinds.size()> reasons{
        "no load was reached by rising from the one before",
        "no load was reached by rising in two sessions; a session is a mounting",
        "no load was reached twice by rising in one session",
        "no load was reached by rising and then by falling between two rests",
        "no rest follows a load in the same session",
        "neither full scale nor the rest after it was held for 300 s of the file's time",
    };
    for (std::size_t k = 0; k < figures.size(); ++k)
        if (figures[k].value.empty())
            figures[k].absent = !levels.empty() || k == kFigureKinds.size() - 1
                                    ? reasons[k]
                                    : fmt::format(
                                          "no load was held for three rows within {:g} % of full scale after a rest "
                                          "of three rows in the same session",
                                          100 * kSameLoad);
    return figures;
}

}  // namespace tactiled
