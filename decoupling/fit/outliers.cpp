#include "decoupling/fit/outliers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <utility>

#include "decoupling/fit/label_errors.hpp"
#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kMaxShareLeftOut = 0.05;  // share of the loads; the limit is this or kMaxLeftOut loads
constexpr std::size_t kMaxLeftOut = 3;
constexpr std::size_t kSmallRecording = 2000;  // number of loads
constexpr std::size_t kNamed = 5;              // loads that a report of ten lines has room for
constexpr int kRounds = 6, kRoundsOfMany = 3;
// A label with a smaller error is not a relevant mistake. The step is the smallest distance of two different labels: if
// they are rounded, each may be off by half of it.
constexpr double kOfFullScale = 0.01, kOfStep = 0.6, kOfRounded = 0.03;
// Omitted from the first fit, because a load that distorts the fit of all rows would hide among the errors that it causes.
constexpr double kTrimmed = 0.02;  // share of the loads; at least kMaxLeftOut loads
// Probabilities that a label is wrong: it is named from the first on, and left out from the second on.
constexpr double kSuspected = 0.5, kSure = 0.9;
constexpr double kNearEnd = 0.9;  // share of the greatest label that is right

// Returns the 99 % quantile of the labels' magnitudes, so that a label with a lost decimal point has no influence.
Wrench robust_full_scale(const Rows& rows) {
    Wrench full_scale{};
    for (std::size_t c = 0; c < 6; ++c) {
        std::vector<double> sizes;
        for (const auto* row : rows)
            if (std::isfinite(row->wrench_S[c])) sizes.push_back(std::abs(row->wrench_S[c]));
        if (!sizes.empty()) full_scale[c] = quantile(std::move(sizes), 0.99);
    }
    return full_scale;
}

// Returns the rows of the loads with the largest errors, each component relative to its full scale.
std::set<const LabelledRow*> rows_of_greatest_errors(const std::vector<Load>& loads,
                                                     const std::vector<std::size_t>& components, const Wrench& full_scale) {
    std::vector<std::pair<double, std::size_t>> greatest;
    for (std::size_t l = 0; l < loads.size(); ++l) {
        double error = 0;
        for (const std::size_t c : components)
            if (std::isfinite(loads[l].error[c])) error = std::max(error, std::abs(loads[l].error[c]) / full_scale[c]);
        greatest.emplace_back(error, l);
    }
    const std::size_t n = std::min(loads.size() / 2, std::max(kMaxLeftOut, std::size_t(kTrimmed * double(loads.size()))));
    std::partial_sort(greatest.begin(), greatest.begin() + std::ptrdiff_t(n), greatest.end(), std::greater<>());
    std::set<const LabelledRow*> result;
    for (std::size_t i = 0; i < n; ++i)
        result.insert(loads[greatest[i].second].rows.begin(), loads[greatest[i].second].rows.end());
    return result;
}

// Returns the minimum error of each label that may be a mistake: a part of full scale, but more than rounding.
Wrench relevant_errors(const Rows& rows, const Wrench& full_scale) {
    Wrench relevant{};
    for (std::size_t c = 0; c < 6; ++c) {
        std::set<double> labels;
        for (const auto* row : rows)
            if (std::isfinite(row->wrench_S[c])) labels.insert(row->wrench_S[c]);
        double step = labels.size() > 1 ? std::numeric_limits<double>::infinity() : 0;
        for (auto at = labels.begin(); at != labels.end() && std::next(at) != labels.end(); ++at)
            step = std::min(step, *std::next(at) - *at);
        relevant[c] = std::clamp(kOfStep * step, kOfFullScale * full_scale[c], kOfRounded * full_scale[c]);
    }
    return relevant;
}

std::string unit_of(std::size_t c) { return c < 3 ? "N" : "Nm"; }

// Returns true if a load of this size may be read wrongly because the sensor bends at the end of its range, which no label
// can deny: it is beyond the other labels, or a saturated sensor reads their end. `min` and `max`: of the labels that are
// right.
bool is_at_the_end(double label, double estimate, double min, double max) {
    if (!std::isfinite(label) || !std::isfinite(estimate)) return false;
    return (max > 0 && label > max && estimate > kNearEnd * max) || (min < 0 && label < min && estimate < kNearEnd * min);
}

struct Judgement {
    double wrong = 0;       // probability
    std::size_t component;  // with the greatest one
    bool at_the_end = false;
};

std::vector<Judgement> judgements(const std::vector<Load>& loads, const std::vector<Wrench>& wrong,
                                  const std::vector<std::size_t>& components, const Wrench& relevant) {
    std::vector<Judgement> judged;
    for (std::size_t l = 0; l < loads.size(); ++l) {
        Judgement& here = judged.emplace_back(Judgement{.component = components.front()});
        double size = 0;
        for (const std::size_t c : components) {
            const double error = std::abs(loads[l].error[c]);
            if (!(error > relevant[c])) continue;
            here.wrong = std::max(here.wrong, wrong[l][c]);
            if (const double own = wrong[l][c] * error / relevant[c]; own > size) size = own, here.component = c;
        }
    }
    Wrench min, max;
    min.fill(std::numeric_limits<double>::infinity());
    max.fill(-std::numeric_limits<double>::infinity());
    for (std::size_t l = 0; l < loads.size(); ++l)
        for (const std::size_t c : components)
            if (judged[l].wrong <= kSuspected && std::isfinite(loads[l].label[c])) {
                min[c] = std::min(min[c], loads[l].label[c]);
                max[c] = std::max(max[c], loads[l].label[c]);
            }
    for (std::size_t l = 0; l < loads.size(); ++l)
        for (const std::size_t c : components)
            judged[l].at_the_end =
                judged[l].at_the_end || (std::abs(loads[l].error[c]) > relevant[c] &&
                                         is_at_the_end(loads[l].label[c], loads[l].estimate[c], min[c], max[c]));
    return judged;
}

}  // namespace

LabelsJudged judge_labels(const Rows& rows, const Refit& refit, bool keep) {
    LabelsJudged judged;
    const Wrench full_scale = robust_full_scale(rows), relevant = relevant_errors(rows, full_scale);
    std::vector<Load> loads = loads_of_same_label(rows, full_scale);
    std::vector<std::size_t> components;
    for (std::size_t c = 0; c < 6; ++c)
        if (full_scale[c] > 0) components.push_back(c);
    if (components.empty()) {
        judged.calibration = refit(rows);
        return judged;
    }
    const Neighbours neighbours = neighbours_of(loads);
    const std::size_t max_left_out = std::max(kMaxLeftOut, std::size_t(kMaxShareLeftOut * double(loads.size())));
    const auto without = [&](const std::set<const LabelledRow*>& out) {
        Rows kept;
        for (const auto* row : rows)
            if (out.count(row) == 0) kept.push_back(row);
        return kept;
    };
    // Each round fits without all suspected loads, so that none of them distorts the fit that judges it.
    std::set<const LabelledRow*> suspected, fitted_without;
    std::vector<Judgement> found;
    for (int round = 0; round < (loads.size() < kSmallRecording ? kRounds : kRoundsOfMany); ++round) {
        try {
            judged.calibration = refit(without(suspected));
        } catch (const Undetermined&) {  // they are needed
            if (suspected.empty()) throw;
            judged.too_many = true;
            break;
        }
        fitted_without = suspected;
        estimate_loads(judged.calibration, loads);
        if (round == 0) try {
                estimate_loads(refit(without(rows_of_greatest_errors(loads, components, full_scale))), loads);
            } catch (const Undetermined&) {  // one of them is needed: judge with all
            }
        found = judgements(loads, wrong_labels(loads, neighbours, full_scale), components, relevant);
        suspected.clear();
        std::size_t n = 0;
        for (std::size_t l = 0; l < loads.size(); ++l)
            if (found[l].wrong > kSuspected) {
                n += found[l].at_the_end ? 0 : 1;
                suspected.insert(loads[l].rows.begin(), loads[l].rows.end());
            }
        judged.too_many = n > max_left_out;
        if (judged.too_many || suspected == fitted_without) break;
    }
    std::set<const LabelledRow*> out;
    for (std::size_t l = 0; l < loads.size(); ++l)
        if (found[l].wrong > kSure && !found[l].at_the_end && !keep && !judged.too_many)
            out.insert(loads[l].rows.begin(), loads[l].rows.end());
    if (out != fitted_without) judged.calibration = refit(without(out));
    for (std::size_t l = 0; l < loads.size(); ++l)
        for (const auto* row : loads[l].rows)
            if (const std::size_t c = found[l].component; found[l].wrong > kSuspected)
                judged.suspects.push_back({.row = row,
                                           .component = c,
                                           .label = row->wrench_S[c],
                                           .expected = loads[l].estimate[c],
                                           .left_out = out.count(row) != 0});
    std::sort(judged.suspects.begin(), judged.suspects.end(),
              [](const Suspect& a, const Suspect& b) { return a.row->line < b.row->line; });
    return judged;
}

void leave_out(const LabelsJudged& judged, Labelled& labelled, Rows& rows) {
    for (const Suspect& suspect : judged.suspects)
        if (suspect.left_out) labelled.rows[std::size_t(suspect.row - labelled.rows.data())].wrench_S = kUnseen;
    std::erase_if(rows, [](const LabelledRow* row) { return !has_label(*row); });
}

double median_error(const Calibration& calibration, const Rows& rows) {
    const Wrench full_scale = robust_full_scale(rows);
    const auto decoupler = make_decoupler(calibration);
    std::array<std::vector<double>, 6> sizes;
    for (const auto* row : rows) {
        const Wrench error = error_of(*decoupler, *row);
        for (std::size_t c = 0; c < 6; ++c)
            if (std::isfinite(error[c]) && full_scale[c] > 0) sizes[c].push_back(std::abs(error[c]) / full_scale[c]);
    }
    double sum = 0, n = 0;
    for (const auto& of_component : sizes)
        if (!of_component.empty()) sum += median(of_component), n += 1;
    return n > 0 ? sum / n : std::numeric_limits<double>::infinity();
}

void report_suspects(const Labelled& labelled, const LabelsJudged& judged, FitReport& report) {
    report.suspects = judged.suspects;
    const auto is_smaller = [](const Suspect& a, const Suspect& b) {
        return std::abs(a.label - a.expected) < std::abs(b.label - b.expected);
    };
    const auto out = std::count_if(judged.suspects.begin(), judged.suspects.end(), [](const auto& s) { return s.left_out; });
    if (!judged.suspects.empty()) {
        const Suspect& worst = *std::max_element(judged.suspects.begin(), judged.suspects.end(), is_smaller);
        report.warnings.push_back(fmt::format(
            "{} of {} rows disagree with the rest in {} (worst {}:{}, by {:.3g} {}): {} left out, {} kept; are their labels "
            "right?",
            judged.suspects.size(), report.rows_read, label_column(worst.component), labelled.name, worst.row->line,
            std::abs(worst.label - worst.expected), unit_of(worst.component), out,
            judged.suspects.size() - std::size_t(out)));
    }
    std::vector<Suspect> worst = judged.suspects;
    std::stable_sort(worst.begin(), worst.end(), [&](const Suspect& a, const Suspect& b) { return is_smaller(b, a); });
    const auto of_one_load = [](const Suspect& a, const Suspect& b) {
        return a.component == b.component && a.label == b.label && a.expected == b.expected;
    };
    worst.erase(std::unique(worst.begin(), worst.end(), of_one_load), worst.end());
    const std::size_t loads = worst.size();
    worst.resize(std::min(loads, kNamed));
    for (const Suspect& suspect : worst)
        report.warnings.push_back(
            fmt::format("  {}: {}:{}: {} is {:.4g}, its channels say {:.4g} {}{}", suspect.left_out ? "left out" : "kept",
                        labelled.name, suspect.row->line, label_column(suspect.component), suspect.label, suspect.expected,
                        unit_of(suspect.component), suspect.left_out || judged.too_many ? "" : ": apply this load again"));
    if (worst.size() < loads)
        report.warnings.push_back(fmt::format("  and {} more loads: --json has all rows", loads - worst.size()));
    if (judged.too_many)
        report.warnings.push_back(fmt::format(
            "more rows disagree than mistyped labels would explain, so none is left out: is a session mounted otherwise, "
            "was a channel damaged, or is method \"{}\" not the one for this sensor (--method auto)?",
            judged.calibration.method));
}

}  // namespace tactiled
