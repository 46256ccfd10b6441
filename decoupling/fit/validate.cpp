#include "decoupling/fit/validate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include "decoupling/domain.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kStretches = 5;  // of time, where there are no sessions to leave out

std::unique_ptr<Decoupler> decoupler_of(const Calibration& calibration) {
    Problems problems;
    Options none = Options::parse_text("", "fit", problems);
    auto decoupler = find_decoupler(calibration.model)->make(calibration, calibration.method, none);
    problems.throw_if_any();
    return decoupler;
}

// Squared errors of each component, summed over rows.
struct Errors {
    Wrench squares{};
    std::array<int, 6> count{};
    Wrench rms() const {
        Wrench result;
        for (std::size_t c = 0; c < result.size(); ++c) result[c] = count[c] == 0 ? kNaN : std::sqrt(squares[c] / count[c]);
        return result;
    }
};

Wrench error_of(Decoupler& decoupler, const LabelledRow& row) {
    const Estimate estimate = decoupler.decouple({.channel = row.channel, .missing = 0, .saturated = 0});
    Wrench error;
    for (std::size_t c = 0; c < error.size(); ++c) error[c] = estimate.wrench_S[c] - row.wrench_S[c];
    return error;
}

void add_errors(const Calibration& calibration, const Rows& rows, Errors& errors) {
    const auto decoupler = decoupler_of(calibration);
    for (const auto* row : rows) {
        const Wrench error = error_of(*decoupler, *row);
        for (std::size_t c = 0; c < error.size(); ++c) {
            if (!std::isfinite(error[c])) continue;
            errors.squares[c] += error[c] * error[c];
            ++errors.count[c];
        }
    }
}

// What is left out, one group after the other.
struct Groups {
    std::vector<std::size_t> of_row;
    std::vector<std::string> names;
    std::string validation;
    bool are_sessions;
};

Groups groups_of(const Labelled& labelled, const Rows& rows) {
    std::vector<bool> occurs(std::max<std::size_t>(labelled.sessions.size(), 1));
    for (const auto* row : rows) occurs[row->session] = true;
    const auto sessions = std::count(occurs.begin(), occurs.end(), true);
    Groups groups{.of_row = {}, .names = {}, .validation = {}, .are_sessions = sessions >= 2};
    if (groups.are_sessions) {
        for (const auto* row : rows) groups.of_row.push_back(row->session);
        for (const auto& name : labelled.sessions) groups.names.push_back("session " + name);
        groups.validation = fmt::format("leave one session out ({} sessions)", sessions);
    } else {
        for (std::size_t i = 0; i < rows.size(); ++i) groups.of_row.push_back(i * kStretches / rows.size());
        for (std::size_t i = 0; i < kStretches; ++i)
            groups.names.push_back(fmt::format("the stretch of time number {} of {}", i + 1, kStretches));
        groups.validation = fmt::format("leave one of {} stretches of time out", kStretches);
    }
    return groups;
}

}  // namespace

Wrench rms_error(const Calibration& calibration, const Rows& rows) {
    Errors errors;
    add_errors(calibration, rows, errors);
    return errors.rms();
}

Wrench held_out_rms(const Labelled& labelled, const Rows& rows, FitModel fit_model, FitReport& report) {
    const Groups groups = groups_of(labelled, rows);
    Errors errors;
    for (std::size_t group = 0; group < groups.names.size(); ++group) {
        Rows seen, unseen;
        for (std::size_t i = 0; i < rows.size(); ++i) (groups.of_row[i] == group ? unseen : seen).push_back(rows[i]);
        if (unseen.empty()) continue;
        Calibration calibration = report.calibration;
        std::vector<std::string> of_this_part;  // said about a part only: not worth repeating
        try {
            fit_model(seen, calibration, of_this_part);
        } catch (const Undetermined& error) {
            report.warnings.push_back(
                fmt::format("not validated, so no standard deviation: without {} the rest does not determine "
                            "the model ({}); record every load twice, or in a second session",
                            groups.names[group], error.what()));
            return kUnseen;
        }
        add_errors(calibration, unseen, errors);
    }
    report.calibration.validation = groups.validation;
    if (!groups.are_sessions)
        report.warnings.emplace_back(
            "one session only: the error after mounting the sensor again, or on another day, is not known");
    return errors.rms();
}

// A swapped or misread label, a load that moved.
void report_outliers(const Labelled& labelled, const Rows& rows, FitReport& report) {
    const auto decoupler = decoupler_of(report.calibration);
    for (const auto& component : report.components) {
        const std::size_t c = component_index(component.name);
        std::vector<std::pair<double, std::int64_t>> errors;  // size, line
        for (const auto* row : rows)
            if (const double error = error_of(*decoupler, *row)[c]; std::isfinite(error))
                errors.emplace_back(std::abs(error), row->line);
        std::sort(errors.begin(), errors.end());
        // 10 robust standard deviations, and a fifth of full scale: bends and hysteresis stay below that.
        const double limit = std::max(10 * 1.4826 * errors[errors.size() / 2].first, 0.2 * component.full_scale);
        const auto first = std::upper_bound(errors.begin(), errors.end(), std::pair(limit, std::int64_t{0}));
        if (first != errors.end())
            report.warnings.push_back(fmt::format(
                "{} of {} rows disagree with the rest in {} (worst {}:{}, by {:.3g} {}): are their labels right?",
                errors.end() - first, errors.size(), label_column(c), labelled.name, errors.back().second,
                errors.back().first, c < 3 ? "N" : "Nm"));
    }
}

}  // namespace tactiled
