// Computes the standard deviation that a calibration states, from the errors on rows that it had not used.
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "decoupling/fit/error_shape.hpp"
#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/solve/load_scale.hpp"
#include "decoupling/unloading.hpp"

namespace tactiled {
namespace {

// Returns for each held-out row the distance of its load from the peak since the last rest, from the labels of all rows.
// A session begins after a rest.
std::map<const LabelledRow*, double> below_peak(const std::vector<HeldOut>& held_out, const Calibration& calibration) {
    std::vector<const LabelledRow*> rows;
    for (const HeldOut& one : held_out) rows.push_back(one.row);
    std::sort(rows.begin(), rows.end(), [](const LabelledRow* a, const LabelledRow* b) { return a->line < b->line; });
    std::map<std::size_t, LoadPeak> of_session;
    std::map<const LabelledRow*, double> result;
    for (const LabelledRow* row : rows) {
        const double load = load_of(row->wrench_S, calibration);
        LoadPeak& peak = of_session.try_emplace(row->session, LoadPeak::rested()).first->second;
        result[row] = peak.next(load, row->t_ns);
    }
    return result;
}

// Returns the weight of each held-out row: rows of one load count together as one, because their errors are alike.
std::map<const LabelledRow*, double> weight_of(const std::vector<HeldOut>& held_out) {
    Rows rows;
    for (const HeldOut& one : held_out) rows.push_back(one.row);
    std::sort(rows.begin(), rows.end(), [](const LabelledRow* a, const LabelledRow* b) { return a->line < b->line; });
    const std::vector<std::size_t> load = loads_of(rows);
    std::map<std::size_t, std::size_t> count;
    for (const std::size_t each : load) ++count[each];
    std::map<const LabelledRow*, double> result;
    for (std::size_t i = 0; i < rows.size(); ++i) result[rows[i]] = 1 / double(count[load[i]]);
    return result;
}

// Student's quantile over the normal one, at one standard deviation: the series of Fisher and Cornish, three terms.
double student(double freedom) {
    return 1 + 1 / (2 * freedom) + 1 / (4 * freedom * freedom) + 1 / (16 * freedom * freedom * freedom);
}

// Returns the number of loads minus the number of coefficients, at least 2.
double freedom_of(const Validation& validation, std::size_t c, const Calibration& calibration) {
    Rows rows = validation.all;
    std::erase_if(rows, [c](const LabelledRow* row) { return !std::isfinite(row->wrench_S[c]); });
    std::sort(rows.begin(), rows.end(), [](const LabelledRow* a, const LabelledRow* b) { return a->line < b->line; });
    return std::max(2.0, double(loads_of(rows).back() + 1) - double(calibration.channels.size() + 1));
}

}  // namespace

void set_uncertainty(const Validation& validation, Calibration& calibration, bool takes_unloading) {
    const std::vector<HeldOut>& rows = validation.drifted.empty() ? validation.rows : validation.drifted;
    const auto clear = [&] {
        calibration.sd.clear();
        calibration.sd_slope.clear();
        calibration.sd_load.clear();
        calibration.sd_unloading.clear();
    };
    clear();
    const auto distance = below_peak(validation.rows, calibration), weight = weight_of(validation.rows);
    const auto states_sd = [&](std::size_t k) { return validation.has_sd.empty() || validation.has_sd[k]; };
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        const double full_scale = calibration.full_scale[i];
        // The standard deviation holds with the zero of the calibration, and after a tare.
        Errors errors;
        for (std::size_t k = 0; k < rows.size(); ++k)
            if (const double error = rows[k].estimated_S[c] - rows[k].row->wrench_S[c];
                std::isfinite(error) && states_sd(k)) {
                // The load is that of the label, because an estimate contains its error.
                const LabelledRow* const row = validation.rows[k].row;
                const auto square = [](double x) { return x * x; };
                errors.plain.push_back({.square = {1, square(row->wrench_S[c] / full_scale),
                                                   square(load_of(row->wrench_S, calibration)), square(distance.at(row))},
                                        .size = std::abs(error),
                                        .weight = weight.at(row),
                                        .group = validation.group[k]});
                errors.tared.push_back(errors.plain.back());
                const auto at_rest = validation.at_rest.find(rows[k].row->session);
                if (at_rest != validation.at_rest.end() && std::isfinite(at_rest->second[c]) && validation.drifted.empty())
                    errors.tared.back().size = std::abs(error - at_rest->second[c]);
            }
        if (errors.plain.size() < kMinErrors) return clear();
        // The load of a single component is the component.
        const Parts parts = variance_of(errors, validation.by_sessions,
                                        {.load = calibration.components.size() > 1, .unloading = takes_unloading});
        const double times = student(freedom_of(validation, c, calibration));
        calibration.sd.push_back(times * std::sqrt(parts[kConstant]));
        calibration.sd_slope.push_back(times * std::sqrt(parts[kSlope]) / full_scale);
        calibration.sd_load.push_back(times * std::sqrt(parts[kLoad]));
        calibration.sd_unloading.push_back(times * std::sqrt(parts[kUnloading]));
    }
    for (auto* sd : {&calibration.sd_load, &calibration.sd_unloading})
        if (std::all_of(sd->begin(), sd->end(), [](double each) { return each == 0; })) sd->clear();
}

}  // namespace tactiled
