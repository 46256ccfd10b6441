#include "decoupling/fit/fit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "decoupling/accuracy.hpp"
#include "decoupling/fit/damage.hpp"
#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/monitor_fit.hpp"
#include "decoupling/fit/outliers.hpp"
#include "decoupling/fit/recording_checks.hpp"
#include "decoupling/fit/trial.hpp"
#include "decoupling/method.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMinRows = 6;  // the labels of fewer rows vary by chance, so they are refused first
constexpr double kTooGood = 1e-6;    // part of full scale: a reference may have six digits

// Returns the requested fits, at least one.
std::vector<const FitEntry*> fits_for(const FitRequest& request) {
    for (const std::string& fault : {fault_of_methods(), fault_of_fits()})
        if (!fault.empty()) throw SetupError(fault);
    const auto of_model = fits_of(request.model);
    if (of_model.empty() && method_names(request.model).empty())
        throw SetupError(fmt::format("model \"{}\" {}", request.model, is_unknown(request.model, model_names())));
    if (of_model.empty()) throw SetupError(fmt::format("no method of model \"{}\" is fitted", request.model));
    if (request.method.empty()) return {of_model.front()};
    if (request.method == "auto") return of_model;
    if (const FitEntry* chosen = find_fit(request.model, request.method); chosen != nullptr) return {chosen};
    std::vector<std::string> names;
    for (const FitEntry* each : of_model) names.emplace_back(each->method);
    throw SetupError(fmt::format("method \"{}\" of model \"{}\" is not fitted; {} are (or auto: all){}", request.method,
                                 request.model, fmt::join(names, " "), or_did_you_mean(request.method, names)));
}

// Keeps rows with a label, with every channel and without saturated channels; counts the others.
Rows usable_rows(const Labelled& labelled, const FitRequest& request, FitReport& report) {
    Rows rows;
    std::array<bool, 6> labelled_at_all{};
    for (const auto& row : labelled.rows) {
        ++report.rows_read;
        if (!has_label(row)) {
            ++report.rows_without_label;
            continue;
        }
        for (std::size_t c = 0; c < labelled_at_all.size(); ++c)
            labelled_at_all[c] = labelled_at_all[c] || std::isfinite(row.wrench_S[c]);
        if (std::any_of(row.channel.begin(), row.channel.end(), [](double value) { return std::isnan(value); }))
            ++report.rows_missing_channel;
        else if (std::any_of(row.channel.begin(), row.channel.end(), [&](double value) {
                     return value <= request.saturates_below || value >= request.saturates_above;
                 }))
            ++report.rows_saturated;
        else
            rows.push_back(&row);
    }
    for (std::size_t c = 0; c < labelled_at_all.size(); ++c) {
        if (!labelled_at_all[c]) continue;
        report.calibration.components.emplace_back(kComponentNames[c]);
        report.components.push_back({.name = kComponentNames[c]});
    }
    if (rows.empty())
        throw Undetermined(report.rows_saturated > 0
                               ? fmt::format("all {} rows with a label are at a saturation limit", report.rows_saturated)
                               : "no row has a label and all channels");
    if (report.rows_saturated > 0)
        report.warnings.push_back(
            fmt::format("{} labelled rows are at a saturation limit: left out", report.rows_saturated));
    if (report.rows_missing_channel > 0)
        report.warnings.push_back(fmt::format("{} labelled rows lack a channel: left out", report.rows_missing_channel));
    return rows;
}

void check_number(const Rows& rows, const FitReport& report) {
    const std::size_t coefficients = report.calibration.channels.size() + 1;
    for (const auto& component : report.components) {
        const std::size_t independent = independent_rows(rows, component_index(component.name));
        if (independent >= kRowsPerCoefficient * coefficients) continue;
        throw Undetermined(fmt::format(
            "{} {} with {} for {} coefficients; at least {} are needed: record more, or use fewer "
            "channels (--channels)",
            independent, independent == std::size_t(component.rows) ? "rows" : "loads (rows of one load count once)",
            component.name, coefficients, kRowsPerCoefficient * coefficients));
    }
}

}  // namespace

FitReport fit(const Labelled& all, const FitRequest& request) {
    const auto methods = fits_for(request);
    FitReport report;
    Calibration& calibration = report.calibration;
    calibration.model = request.model;
    calibration.serial = request.serial;
    calibration.contact_model = request.contact_model;
    calibration.channel_unit = request.channel_unit;
    calibration.date = request.date;

    if (const auto n = std::count_if(all.rows.begin(), all.rows.end(), has_label); n < std::ptrdiff_t(kMinRows))
        throw Undetermined(
            fmt::format("{} rows with a label; at least {} a coefficient are needed, {} for {} channels: record more", n,
                        kRowsPerCoefficient, kRowsPerCoefficient * (all.channels.size() + 1), all.channels.size()));
    const auto labelled = std::make_shared<Labelled>(with_useful_channels(all, *methods.front(), report.warnings));
    report.labelled = labelled;
    calibration.channels = labelled->channels;
    Rows rows = usable_rows(*labelled, request, report);
    calibration.repeats = repeats_of(rows);
    check_numbers(*labelled, rows, report.warnings);
    if (const std::string odd = press_without_sign(rows); !odd.empty()) report.warnings.push_back(odd);
    check_labels(rows, report);
    check_number(rows, report);
    const bool remembers = methods.front()->remembers;
    if (!remembers) check_recording(*labelled, rows, report.warnings);
    Temperature temperature;  // set in the calibration at the end: until then all rows are at the reference
    if (!remembers) temperature = take_temperature_off(rows, *labelled, calibration, request.dummy, report.warnings);
    if (!temperature.zero_per_K.empty())  // a row without a temperature cannot be corrected
        std::erase_if(rows, [](const LabelledRow* row) { return !std::isfinite(row->temperature_C); });
    Calibration raw;  // domain of the readings without a tare
    raw.channels = labelled->channels;
    set_domain(rows, raw);
    if (!remembers) {
        report.zeros = session_zeros(*labelled, rows, request.zeros);
        say_zeros(*labelled, report.zeros, raw, report.warnings);
        if (report.zeros.own) take_zeros_off(report.zeros, *labelled);
    }
    const ZeroDrift drift = remembers ? ZeroDrift{} : zero_drift_of(request, rows, report.zeros);
    calibration.zero_drift = drift.sd;

    const auto set_size = [&] {
        check_labels(rows, report);
        check_number(rows, report);
        calibration.rows = int(rows.size());
        calibration.full_scale.clear();
        for (const auto& component : report.components) calibration.full_scale.push_back(component.full_scale);
    };
    set_size();
    const auto now = [] { return std::chrono::steady_clock::now(); };
    const auto since = [&](auto begun) { return std::chrono::duration<double>(now() - begun).count(); };
    std::vector<Trial> trials;
    for (const FitEntry* method : methods) {
        Trial& trial = trials.emplace_back();
        trial.method = method;
        trial.about.method = method->method;
    }
    const auto refuse = [&](Trial& trial, const Undetermined& error) {
        if (methods.size() == 1) throw error;
        trial.about.refused = error.what();
    };
    const auto fit_all = [&] {
        for (Trial& trial : trials) {
            if (!trial.about.refused.empty()) continue;
            const auto begun = now();
            try {
                trial.start = start_of(*trial.method, request, report);
                trial.calibration = fit_rows(*trial.method, trial.start, rows, drift.sd, trial.warnings);
            } catch (const Undetermined& error) { refuse(trial, error); }
            trial.about.seconds += since(begun);
        }
    };
    if (methods.size() > 1 || remembers) fit_all();
    if (std::none_of(trials.begin(), trials.end(), [](const Trial& trial) { return trial.about.refused.empty(); }))
        throw Undetermined(trials.front().about.refused);
    if (!remembers) {
        // The labels are checked with the method that fits most of them best.
        Trial* judge = &trials.front();
        double min = std::numeric_limits<double>::infinity();
        for (Trial& trial : trials) {
            if (methods.size() == 1 || !trial.about.refused.empty()) continue;
            const double error = median_error(trial.calibration, rows);
            if (!(error < min)) continue;
            min = error;
            judge = &trial;
        }
        const auto begun = now();
        judge->start = start_of(*judge->method, request, report);
        const std::size_t n_judged = rows.size();
        // The first fit searches widths and ridges; judging labels needs no better ones.
        Calibration found = judge->start;
        const Refit refit = [&](const Rows& some) {
            return found = fit_rows(*judge->method, found, some, drift.sd, judge->warnings);
        };
        const Refit refit_some = [&](const Rows& some) {
            return methods.size() > 1 && some.size() == n_judged ? judge->calibration : refit(some);
        };
        LabelsJudged judged = judge_labels(rows, refit_some, request.keep_outliers);
        leave_out(judged, *labelled, rows);
        report_suspects(*labelled, judged, report);
        judge->calibration = judged.calibration;
        judge->about.seconds += since(begun);
        const auto out = std::count_if(judged.suspects.begin(), judged.suspects.end(),
                                       [](const Suspect& suspect) { return suspect.left_out; });
        if (out > 0) {
            // A rejected label sets no full scale and does not show that an axis was loaded.
            set_size();
            calibration.rows = int(n_judged) - int(out);
            fit_all();
        }
    }
    for (Trial& trial : trials) {
        if (!trial.about.refused.empty()) continue;
        const auto begun = now();
        trial.calibration.rows = calibration.rows;
        trial.calibration.full_scale = calibration.full_scale;
        try {
            validate(*labelled, rows, drift, report, trial);
        } catch (const Undetermined& error) { refuse(trial, error); }
        trial.about.seconds += since(begun);
        if (!report.zeros.own) continue;
        // Readings before a tare must count as inside the domain.
        for (std::size_t k = 0; k < raw.channels.size(); ++k) {
            trial.calibration.channel_least[k] = std::min(trial.calibration.channel_least[k], raw.channel_least[k]);
            trial.calibration.channel_most[k] = std::max(trial.calibration.channel_most[k], raw.channel_most[k]);
        }
        if (!trial.calibration.validation.empty()) trial.calibration.validation += Calibration::kOwnZeros;
    }

    std::vector<Trial*> all_fitted;
    for (Trial& trial : trials) {
        report.methods.push_back(trial.about);
        const std::vector<std::string> said = report.warnings;
        for (std::string& warning : trial.warnings) {
            const auto ends_so = [&](const std::string& other) { return other.ends_with(warning); };
            if (std::none_of(said.begin(), said.end(), ends_so))
                report.warnings.push_back(methods.size() == 1 ? warning
                                                              : fmt::format("method {}: {}", trial.about.method, warning));
        }
        if (trial.about.refused.empty()) all_fitted.push_back(&trial);
    }
    if (all_fitted.empty()) throw Undetermined(report.methods.front().refused);
    // All methods report the same for the same rows: each text is printed once.
    std::vector<std::string> once;
    for (std::string& warning : report.warnings)
        if (std::find(once.begin(), once.end(), warning) == once.end()) once.push_back(std::move(warning));
    report.warnings = std::move(once);
    std::stable_sort(all_fitted.begin(), all_fitted.end(), [&](const Trial* a, const Trial* b) {
        return inaccuracy(a->calibration) < inaccuracy(b->calibration);
    });
    calibration = all_fitted.front()->calibration;
    for (std::size_t i = 1; i < all_fitted.size(); ++i) calibration.others.push_back(all_fitted[i]->calibration);
    const Validation& validation = all_fitted.front()->validation;
    report.held_out = validation.rows;
    report.ways = all_fitted.front()->ways;
    report.crosstalk = crosstalk(report.held_out, calibration);
    const Wrench fitted = rms_error(calibration, rows);
    // The channels of a sensor that does not measure a lasting load (piezo) depend on the past, so that any
    // combination of them is possible.
    if (!remembers) set_monitor(rows, ways_to_hold_out(*labelled, rows, false).front().of_row, report.zeros, calibration);
    report.drift_measured = !remembers && set_zero_age(*labelled, rows, report.zeros, calibration, report.warnings);
    calibration.temperature = std::move(temperature);
    for (auto& component : report.components) {
        const std::size_t c = component_index(component.name);
        component.fitted_rms = fitted[c];
        component.held_out_rms = validation.rms[c];
        if (component.held_out_rms < kTooGood * component.full_scale)
            report.warnings.insert(report.warnings.begin(),
                                   fmt::format("{}: no sensor is as good as that: is a channel a copy of the label? "
                                               "Choose with --channels",
                                               component.name));
        if (component.held_out_rms >= component.spread)
            report.warnings.insert(
                report.warnings.begin(),
                fmt::format("{}: held-out error {:.3g} is no smaller than the spread {:.3g} of its labels: these channels "
                            "do not determine {}, or a part that was left out alone loads this axis{}",
                            component.name, component.held_out_rms, component.spread, component.name,
                            validation.by_sessions ? ", or a session has another unit, gain or order of the channels" : ""));
    }
    if (!remembers) set_undetected_damage(rows, calibration);
    for (const auto& [name, value] : request.parameters)
        if (std::none_of(all_fitted.begin(), all_fitted.end(), [&, key = name, wanted = value](const Trial* one) {
                return one->calibration.parameters.count(key) != 0 && one->calibration.parameters.at(key) == wanted;
            }))
            report.warnings.push_back(fmt::format(
                "parameter {} = {} was not used: the fit has none of that name or finds it itself", name, value));
    return report;
}

}  // namespace tactiled
