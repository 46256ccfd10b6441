#include "decoupling/fit/fit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "decoupling/accuracy.hpp"
#include "decoupling/fit/joint_domain_fit.hpp"
#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/outliers.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/method.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kIllConditioned = 1000;  // 0.1 % of noise in a channel becomes 100 % of a coefficient

constexpr double kTooGood = 1e-6;  // of full scale: six digits are what a reference may have

// The fits that were asked for, at least one.
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

// Rows that have a label and every channel; counts the others.
Rows usable_rows(const Labelled& labelled, FitReport& report) {
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
        else
            rows.push_back(&row);
    }
    for (std::size_t c = 0; c < labelled_at_all.size(); ++c) {
        if (!labelled_at_all[c]) continue;
        report.calibration.components.emplace_back(kComponentNames[c]);
        report.components.push_back({.name = kComponentNames[c]});
    }
    if (rows.empty()) throw Undetermined("no row has a label and all channels");
    if (report.rows_missing_channel > 0)
        report.warnings.push_back(fmt::format("{} labelled rows lack a channel: left out", report.rows_missing_channel));
    return rows;
}

void check_number(const Rows& rows, const FitReport& report) {
    const std::size_t coefficients = report.calibration.channels.size() + 1;
    for (const auto& component : report.components) {
        const std::size_t independent = independent_rows(rows, component_index(component.name));
        if (independent >= kRowsPerCoefficient * coefficients) continue;
        throw Undetermined(
            fmt::format("{} {} with {} for {} coefficients; at least {} are needed", independent,
                        independent == std::size_t(component.rows) ? "rows" : "loads (rows of one load count once)",
                        component.name, coefficients, kRowsPerCoefficient * coefficients));
    }
}

struct Fitted {
    Calibration calibration;
    MethodReport about;
    Validation validation;
};

Fitted fit_one(const Labelled& labelled, const Rows& rows, const FitEntry& method, const FitRequest& request,
               FitReport& report) {
    Fitted fitted{.calibration = report.calibration, .about = {}, .validation = {}};
    Calibration& calibration = fitted.calibration;
    if (const auto start = request.start.find(std::string(method.method)); start != request.start.end())
        static_cast<Fit&>(calibration) = start->second;
    for (const auto& [name, value] : request.parameters) calibration.parameters[name] = value;
    calibration.method = method.method;
    fitted.about.method = method.method;
    set_domain(rows, calibration);
    const Calibration start = calibration;
    method.fit(rows, calibration, report.warnings);
    if (calibration.condition > kIllConditioned)
        report.warnings.push_back(fmt::format(
            "condition number {:.2g}: the channels nearly repeat each other, noise is amplified", calibration.condition));
    // A search's result may serve the parts too, where it is a mere width; a time constant is to be found again.
    fitted.validation = hold_out(labelled, rows, method, method.remembers ? start : calibration, report.warnings);
    calibration.validation = fitted.validation.how;
    set_uncertainty(fitted.validation.rows, calibration);
    // A search may end worse on all rows than it did on parts of them (mlp, by up to 1.6): what is held out then speaks of
    // other calibrations than this one.
    const Wrench own = rms_error(calibration, rows);
    for (std::size_t i = 0; i < calibration.sd.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        if (!(own[c] > fitted.validation.rms[c]) || !(fitted.validation.rms[c] > 0)) continue;
        calibration.sd[i] *= own[c] / fitted.validation.rms[c];
        if (!calibration.sd_slope.empty()) calibration.sd_slope[i] *= own[c] / fitted.validation.rms[c];
    }
    for (const auto& component : report.components)
        fitted.about.held_out_rms.push_back(fitted.validation.rms[component_index(component.name)]);
    return fitted;
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

    const auto labelled = std::make_shared<const Labelled>(with_useful_channels(all, *methods.front(), report.warnings));
    report.labelled = labelled;
    calibration.channels = labelled->channels;
    Rows rows = usable_rows(*labelled, report);
    check_labels(rows, report);
    check_number(rows, report);
    if (Rows kept = methods.front()->remembers ? rows : without_outliers(*labelled, rows, report);
        kept.size() < rows.size()) {
        // A label that is left out sets no full scale, and is no reason to believe that an axis was loaded.
        rows = std::move(kept);
        check_labels(rows, report);
        check_number(rows, report);
    }
    calibration.rows = int(rows.size());
    for (const auto& component : report.components) calibration.full_scale.push_back(component.full_scale);

    std::vector<Fitted> all_fitted;
    for (const FitEntry* const entry : methods) {
        const FitEntry& method = *entry;
        // Of several methods each says which one it is, and what another has said is not said again.
        const std::vector<std::string> before = std::exchange(report.warnings, {});
        const auto keep_warnings = [&] {
            std::vector<std::string> said = before;
            for (const std::string& warning : report.warnings) {
                const auto ends_so = [&](const std::string& other) { return other.ends_with(warning); };
                if (std::none_of(said.begin(), said.end(), ends_so))
                    said.push_back(methods.size() == 1 ? warning : fmt::format("method {}: {}", method.method, warning));
            }
            report.warnings = std::move(said);
        };
        try {
            all_fitted.push_back(fit_one(*labelled, rows, method, request, report));
            keep_warnings();
            report.methods.push_back(all_fitted.back().about);
        } catch (const Undetermined& error) {
            if (methods.size() == 1) throw;
            keep_warnings();
            report.methods.push_back({.method = std::string(method.method), .held_out_rms = {}, .refused = error.what()});
        }
    }
    if (all_fitted.empty()) throw Undetermined(report.methods.front().refused);
    // Each method looks at the same rows and says the same of them: once is enough.
    std::vector<std::string> once;
    for (std::string& warning : report.warnings)
        if (std::find(once.begin(), once.end(), warning) == once.end()) once.push_back(std::move(warning));
    report.warnings = std::move(once);
    std::stable_sort(all_fitted.begin(), all_fitted.end(), [&](const Fitted& a, const Fitted& b) {
        return inaccuracy(a.calibration) < inaccuracy(b.calibration);
    });
    calibration = all_fitted.front().calibration;
    for (std::size_t i = 1; i < all_fitted.size(); ++i) calibration.others.push_back(all_fitted[i].calibration);
    const Validation& validation = all_fitted.front().validation;
    report.held_out = validation.rows;
    report.crosstalk = crosstalk(report.held_out, calibration);
    const Wrench fitted = rms_error(calibration, rows);
    // The channels of a sensor that forgets a lasting load (piezo) depend on the past: any of their combinations may come.
    if (!methods.front()->remembers) set_joint_domain(rows, groups_of_rows(*labelled, rows, false), calibration);
    for (auto& component : report.components) {
        const std::size_t c = component_index(component.name);
        component.fitted_rms = fitted[c];
        component.held_out_rms = validation.rms[c];
        if (component.held_out_rms < kTooGood * component.full_scale)
            report.warnings.push_back(
                fmt::format("{}: no sensor is as good as that: is a channel a copy of the label? "
                            "Choose with --channels",
                            component.name));
        if (component.held_out_rms >= component.spread)
            report.warnings.push_back(
                fmt::format("{}: held-out error {:.3g} is no smaller than the spread {:.3g} of its labels: these "
                            "channels do not tell {}, or a part that was left out alone loads this axis",
                            component.name, component.held_out_rms, component.spread, component.name));
    }
    for (const auto& [name, value] : request.parameters)
        if (std::none_of(all_fitted.begin(), all_fitted.end(), [&, key = name](const Fitted& one) {
                return one.calibration.parameters.count(key) != 0 && one.calibration.parameters.at(key) == value;
            }))
            report.warnings.push_back(fmt::format(
                "parameter {} = {} was not used: the fit has none of that name or finds it itself", name, value));
    report_disagreement(*labelled, rows, report);
    return report;
}

}  // namespace tactiled
