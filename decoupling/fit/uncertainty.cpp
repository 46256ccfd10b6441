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

// Returns the correlation of the errors of fz with those of mx and of my, in units of the stated sd; empty if the
// calibration does not see fz and one of them.
std::vector<double> correlation_of(const std::vector<HeldOut>& rows, const Calibration& calibration) {
    const auto index = [&](std::size_t c) {
        const auto& names = calibration.components;
        return std::size_t(std::ranges::find(names, kComponentNames[c]) - names.begin());
    };
    const std::size_t n = calibration.components.size(), fz = index(2);
    if (fz == n || (index(3) == n && index(4) == n)) return {};
    std::vector<double> result(2, 0);
    for (std::size_t k = 0; k < 2; ++k) {
        const std::size_t moment = index(3 + k);
        if (moment == n) continue;
        double both = 0, of_force = 0, of_moment = 0;
        for (const HeldOut& one : rows) {
            const double a = (one.estimated_S[2] - one.row->wrench_S[2]) / stated_sd(calibration, fz, one.estimated_S);
            const double b =
                (one.estimated_S[3 + k] - one.row->wrench_S[3 + k]) / stated_sd(calibration, moment, one.estimated_S);
            if (!std::isfinite(a * b)) continue;
            both += a * b;
            of_force += a * a;
            of_moment += b * b;
        }
        if (of_force > 0 && of_moment > 0) result[k] = std::clamp(both / std::sqrt(of_force * of_moment), -1.0, 1.0);
    }
    return result;
}

}  // namespace

void set_uncertainty(const Validation& validation, Calibration& calibration, bool takes_unloading) {
    const std::vector<HeldOut>& rows = validation.drifted.empty() ? validation.rows : validation.drifted;
    const auto clear = [&] {
        calibration.sd.clear();
        calibration.sd_slope.clear();
        calibration.sd_load.clear();
        calibration.sd_unloading.clear();
        calibration.correlation.clear();
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
    calibration.correlation = correlation_of(rows, calibration);
}

}  // namespace tactiled
