// Computes the standard deviation that a calibration states, from the errors on rows that it had not used.
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
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
    const auto distance = below_peak(validation.rows, calibration);
    const auto states_sd = [&](std::size_t k) { return validation.has_sd.empty() || validation.has_sd[k]; };
    const auto is_loaded = [&](std::size_t k) { return load_of(rows[k].row->wrench_S, calibration) >= LoadPeak::kRest; };
    std::vector<std::size_t> order(rows.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_partition(order.begin(), order.end(), is_loaded);
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        const double full_scale = calibration.full_scale[i];
        // The standard deviation holds with the zero of the calibration, and after a tare. Loaded rows come first.
        Errors errors;
        for (const std::size_t k : order)
            if (const double error = rows[k].estimated_S[c] - rows[k].row->wrench_S[c];
                std::isfinite(error) && states_sd(k)) {
                errors.plain.push_back({std::pow(rows[k].estimated_S[c] / full_scale, 2),
                                        std::pow(load_of(rows[k].estimated_S, calibration), 2),
                                        std::pow(distance.at(validation.rows[k].row), 2), std::abs(error),
                                        validation.group[k]});
                errors.tared.push_back(errors.plain.back());
                errors.loaded += is_loaded(k) ? 1 : 0;
                const auto at_rest = validation.at_rest.find(rows[k].row->session);
                if (at_rest != validation.at_rest.end() && std::isfinite(at_rest->second[c]) && validation.drifted.empty())
                    errors.tared.back().size = std::abs(error - at_rest->second[c]);
            }
        if (errors.plain.size() < kMinErrors) return clear();
        const std::size_t n = calibration.components.size();
        const Shape best = best_shape(errors, validation.by_sessions, n, takes_unloading);
        double scale = scale_of(errors, best, validation.by_sessions, n);
        scale *= student(freedom_of(validation, c, calibration));
        calibration.sd.push_back(scale);
        calibration.sd_slope.push_back(scale * best.slope / full_scale);
        calibration.sd_load.push_back(scale * best.load);
        calibration.sd_unloading.push_back(scale * best.unloading);
    }
    for (auto* sd : {&calibration.sd_load, &calibration.sd_unloading})
        if (std::all_of(sd->begin(), sd->end(), [](double each) { return each == 0; })) sd->clear();
}

}  // namespace tactiled
