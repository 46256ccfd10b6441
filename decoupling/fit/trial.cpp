#include "decoupling/fit/trial.hpp"
#include "decoupling/fit/error_structure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/method.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kIllConditioned = 1000;  // 0.1 % of noise in a channel becomes 100 % of a coefficient

void widen_sd(Calibration& calibration, std::size_t i, double times) {
    for (auto* sd : {&calibration.sd, &calibration.sd_slope, &calibration.sd_load, &calibration.sd_unloading})
        if (!sd->empty()) (*sd)[i] *= times;
}

// A tare subtracts the zero of a mounting from the force and not from the channels, so a nonlinear method then gives another
// load. Increases the errors and the standard deviations by that.
void include_tares(const Rows& rows, const SessionZeros& zeros, Trial& trial) {
    Calibration& calibration = trial.calibration;
    const std::size_t n = calibration.channels.size();
    if (!zeros.own || calibration.zero.size() != n) return;
    const auto decoupler = make_decoupler(calibration);
    const auto force = [&](const std::vector<double>& channel, const std::vector<double>& offset) {
        std::vector<double> reading(n);
        for (std::size_t k = 0; k < n; ++k) reading[k] = channel[k] + offset[k];
        return decoupler->decouple({.channel = reading}).wrench_S;
    };
    const std::vector<double> none(n);
    const Wrench at_zero = force(calibration.zero, none);
    Wrench squares{};
    for (const auto* row : rows) {
        const std::vector<double>& offset = zeros.offset[row->session];
        if (offset.empty()) continue;  // a session without a zero of its own
        const Wrench tared = force(row->channel, offset), rest = force(calibration.zero, offset),
                     plain = force(row->channel, none);
        for (std::size_t c = 0; c < 6; ++c)
            squares[c] += std::pow(tared[c] - rest[c] - plain[c] + at_zero[c], 2) / double(rows.size());
    }
    std::string wider;
    for (std::size_t i = 0; i < calibration.sd.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        double& rms = trial.validation.rms[c];
        if (!(squares[c] > 0) || !(rms > 0)) continue;
        const double times = std::sqrt(1 + squares[c] / (rms * rms));
        if (times > 1.4) wider += fmt::format("{}{} {:.2g}", wider.empty() ? "" : ", ", calibration.components[i], times);
        rms *= times;
        widen_sd(calibration, i, times);
    }
    if (!wider.empty())
        trial.warnings.push_back(fmt::format(
            "method {} is not straight, so that a tare does not take the zeros of the sessions off entirely: its "
            "errors are greater by these factors: {}; method matrix has none of this",
            calibration.method, wider));
}

// Takes the error and the standard deviation of each component that has a larger error in this way to hold rows out.
void take_larger(const Validation& way, Trial& trial) {
    Calibration& calibration = trial.calibration;
    Calibration other = calibration;
    set_uncertainty(way, other, !trial.method->remembers);
    const std::size_t n = calibration.components.size();
    if (other.sd.size() != n || calibration.sd.size() != n) return;
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        if (!(way.rms[c] > trial.validation.rms[c])) continue;
        trial.validation.rms[c] = way.rms[c];
        trial.validation.rms_of_part[c] = way.rms_of_part[c];
        for (const auto member :
             {&Calibration::sd, &Calibration::sd_slope, &Calibration::sd_load, &Calibration::sd_unloading}) {
            const std::vector<double>& from = other.*member;
            std::vector<double>& to = calibration.*member;
            if (from.empty() && to.empty()) continue;
            to.resize(n);
            to[i] = from.empty() ? 0 : from[i];
        }
    }
}

// Sets validation, standard deviations and their widening by tares.
void validate_once(const Labelled& labelled, const Rows& rows, const ZeroDrift& drift, const FitReport& report,
                   Trial& trial) {
    const FitEntry& method = *trial.method;
    Calibration& calibration = trial.calibration;
    // The result of a search may also serve the parts if it is only a width; a time constant must be determined
    // again.
    Calibration start = method.remembers ? trial.start : calibration;
    if (method.remembers) set_domain(rows, start);
    std::vector<Validation> ways = hold_out_all_ways({labelled, rows, method, start, drift}, trial.ways, trial.warnings);
    if (ways.empty()) ways.emplace_back();
    const auto at_rest = errors_at_rest(calibration, rows);
    for (Validation& way : ways) way.at_rest = at_rest;
    trial.validation = ways.front();
    calibration.validation = trial.validation.how;
    set_uncertainty(trial.validation, calibration, !method.remembers);
    for (std::size_t i = 1; i < ways.size(); ++i) take_larger(ways[i], trial);
    // A search may have a larger error on all rows than on parts of them (mlp, by up to 1.6): the held-out errors
    // then describe other calibrations than this one.
    const Wrench own = rms_error(calibration, rows);
    for (std::size_t i = 0; i < calibration.sd.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        if (!(own[c] > trial.validation.rms[c]) || !(trial.validation.rms[c] > 0)) continue;
        widen_sd(calibration, i, own[c] / trial.validation.rms[c]);
    }
    include_tares(rows, report.zeros, trial);
    set_error_structure(trial.validation, calibration);
}

// Removes the correction of the components whose held-out error it does not lower: its rows in the tables with a row per
// component. With one session, the search of the fit leaves out other rows than the validation, and it does not include
// tares. Returns a warning if it removed one, else "".
std::string keep_part_where_worse(const FitReport& report, Trial& trial) {
    std::string kept;
    for (std::size_t i = 0; i < report.components.size(); ++i) {
        const std::size_t c = component_index(report.components[i].name);
        if (!(trial.validation.rms[c] > trial.validation.rms_of_part[c])) continue;
        bool any = false;
        for (const KnownTable& known : find_method(trial.method->model, trial.method->method)->tables) {
            const auto table = trial.calibration.tables.find(known.name);
            if (known.rows != kPerComponent || table == trial.calibration.tables.end()) continue;
            for (double& value : table->second[i]) {
                any = any || value != 0;
                value = 0;
            }
        }
        if (any) kept += fmt::format("{}{}", kept.empty() ? "" : ", ", report.components[i].name);
    }
    if (kept.empty()) return "";
    return fmt::format("method {} keeps method {} for {}: its held-out error is not lower", trial.calibration.method,
                       trial.method->adds_to, kept);
}

}  // namespace

Calibration start_of(const FitEntry& method, const FitRequest& request, const FitReport& report) {
    Calibration calibration = report.calibration;
    if (const auto start = request.start.find(std::string(method.method)); start != request.start.end())
        static_cast<Fit&>(calibration) = start->second;
    for (const auto& [name, value] : request.parameters) calibration.parameters[name] = value;
    calibration.method = method.method;
    return calibration;
}

Calibration fit_rows(const FitEntry& method, const Calibration& start, const Rows& rows, const std::vector<double>& drift,
                     std::vector<std::string>& warnings) {
    Calibration calibration = start;
    set_domain(rows, calibration);
    warnings.clear();
    fit_with_drift(method, rows, drift, calibration, warnings);
    return calibration;
}

void validate(const Labelled& labelled, const Rows& rows, const ZeroDrift& drift, const FitReport& report, Trial& trial) {
    const FitEntry& method = *trial.method;
    Calibration& calibration = trial.calibration;
    if (calibration.condition > kIllConditioned)
        trial.warnings.push_back(fmt::format(
            "condition number {:.2g}: the channels nearly repeat each other, noise is amplified", calibration.condition));
    std::vector<std::string> warnings = trial.warnings;
    validate_once(labelled, rows, drift, report, trial);
    if (!method.adds_to.empty() && !method.must_gain)
        if (std::string kept = keep_part_where_worse(report, trial); !kept.empty()) {
            trial.warnings = std::move(warnings);
            trial.warnings.push_back(std::move(kept));
            validate_once(labelled, rows, drift, report, trial);
        }
    for (const auto& component : report.components)
        trial.about.held_out_rms.push_back(trial.validation.rms[component_index(component.name)]);
    const auto known = [](double rms) { return std::isfinite(rms); };
    if (std::all_of(trial.about.held_out_rms.begin(), trial.about.held_out_rms.end(), known))
        calibration.held_out_rms = trial.about.held_out_rms;
    if (method.must_gain) {
        // The parts may gain where the calibration of all rows does not.
        Calibration part = calibration;
        part.method = method.adds_to;
        const Wrench own = rms_error(calibration, rows), of_part = rms_error(part, rows);
        bool gains = false;
        for (const auto& component : report.components) {
            const std::size_t c = component_index(component.name);
            gains = gains || own[c] < of_part[c];
        }
        if (!gains)
            throw Undetermined(
                fmt::format("method {0} gains nothing: no start gave a correction that helps on rows left out; "
                            "use method {1}",
                            method.method, method.adds_to));
    }
    if (method.adds_to.empty() || calibration.validation.empty()) return;
    std::string worse;
    for (const auto& component : report.components) {
        const std::size_t c = component_index(component.name);
        if (method.must_gain && trial.validation.rms[c] > trial.validation.rms_of_part[c])
            worse += fmt::format("{}{} ({:.3g} against {:.3g} % of full scale)", worse.empty() ? "" : ", ", component.name,
                                 100 * trial.validation.rms[c] / component.full_scale,
                                 100 * trial.validation.rms_of_part[c] / component.full_scale);
    }
    if (!worse.empty())
        trial.warnings.push_back(fmt::format("its held-out error is above that of method {} in {}", method.adds_to, worse));
    const double error = mean_share(trial.validation.rms, calibration),
                 before = mean_share(trial.validation.rms_of_part, calibration);
    if (error < before || !std::isfinite(error) || !std::isfinite(before)) return;
    const std::string text = fmt::format(
        "its held-out error, {:.3g} % of full scale in the mean, is not lower than the {:.3g} % of method {} alone: use "
        "that one",
        100 * error, 100 * before, method.adds_to);
    if (method.must_gain) throw Undetermined(fmt::format("method {} gains nothing: {}", method.method, text));
    trial.warnings.push_back(text);
}

}  // namespace tactiled
