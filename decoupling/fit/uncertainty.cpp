// Computes the standard deviation that a calibration states, from the errors on rows that it had not used.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/solve/load_scale.hpp"
#include "decoupling/unloading.hpp"

namespace tactiled {
namespace {

constexpr double kWithinOne = 0.6827;  // share of normal errors within one standard deviation
// Other shares of normal errors, the corresponding number of standard deviations, and the minimum number of errors for a
// quantile that does not depend on a single row.
struct Tail {
    double share, sds;
    std::size_t errors;
};
constexpr Tail kTails[] = {{kWithinOne, 1, 8}, {0.95, 1.96, 40}, {0.99, 2.576, 200}};
constexpr std::size_t kRowsOfAGroup = 10;  // minimum number of rows of a group whose root mean square counts
// Slopes of an error that grows with its component, with the load, and with the distance from the greatest load since the
// last rest: its standard deviation is
// s sqrt(1 + (slope |estimate| / full scale)^2 + (load slope load)^2 + (unloading (peak - load))^2).
constexpr double kSlopes[] = {0, 0.5, 1, 2, 4, 8, 16, 32};
constexpr double kLoadSlopes[] = {0, 0.5, 1, 2, 4, 8};  // limited, because few rows are at rest: the sd at rest is at least
                                                        // a ninth
constexpr double kUnloadings[] = {0, 0.5, 1, 2, 4, 8};
// Unloading counts if it makes the standard deviations this much smaller: less may be chance.
constexpr double kWorth = 0.95;

struct Error {
    // squares of |estimate| / full scale, of the load, and of its peak since the last rest minus the load, 0 .. 1
    double share, load, below_peak;
    double size;
    std::size_t group;
};

struct Shape {
    double slope = 0, load = 0, unloading = 0;
};

double size(const Error& error, const Shape& shape) {
    return std::sqrt(1 + shape.slope * shape.slope * error.share + shape.load * shape.load * error.load +
                     shape.unloading * shape.unloading * error.below_peak);
}

// An error in units of its shape, and the shape's size.
struct Ratio {
    double size, ratio;
};

// Returns the value of s that has `tail.share` of the errors within `tail.sds` standard deviations. Reorders `ratios`.
double scale_for(std::span<Ratio> ratios, const Tail& tail) {
    const auto at = std::min(ratios.size() - 1, std::size_t(std::ceil(tail.share * double(ratios.size()))));
    std::nth_element(ratios.begin(), ratios.begin() + std::ptrdiff_t(at), ratios.end(),
                     [](const Ratio& a, const Ratio& b) { return a.ratio < b.ratio; });
    return ratios[at].ratio / tail.sds;
}

std::vector<Ratio> ratios_of(const std::vector<Error>& errors, const Shape& shape) {
    std::vector<Ratio> ratios;
    for (const Error& error : errors) {
        const double of_shape = size(error, shape);
        ratios.push_back({of_shape, error.size / of_shape});
    }
    return ratios;
}

// Returns the smallest s that is valid for all `ratios`, which are reordered.
double scale_for(std::span<Ratio> ratios) {
    double needed = 0;
    for (const Tail& tail : kTails)
        if (ratios.size() >= tail.errors) needed = std::max(needed, scale_for(ratios, tail));
    return needed;
}

// Returns the smallest s that is valid for all `ratios` and for the first `loaded` of them: a recording that rests most of
// the time would otherwise state the errors at rest. Reorders `ratios`.
double scale_for_all_and(std::size_t loaded, std::span<Ratio> ratios) {
    const double of_loaded = scale_for(ratios.first(loaded));
    return std::max(of_loaded, scale_for(ratios));
}

// Returns the smallest s that is valid for each quarter of `ratios`, from the smallest to the largest standard deviation, so
// that a shape that is too small for light loads is no gain. Reorders `ratios`.
double scale_for_quarters(std::span<Ratio> ratios) {
    const std::size_t n = ratios.size(), half = n / 2;
    const auto split = [](std::span<Ratio> part, std::size_t at) {
        std::nth_element(part.begin(), part.begin() + std::ptrdiff_t(at), part.end(),
                         [](const Ratio& a, const Ratio& b) { return a.size < b.size; });
    };
    split(ratios, half);
    split(ratios.first(half), half / 2);
    split(ratios.subspan(half), (n - half) / 2);
    const std::size_t ends[] = {0, half / 2, half, half + (n - half) / 2, n};
    double needed = 0;
    for (std::size_t i = 0; i < 4; ++i) needed = std::max(needed, scale_for(ratios.subspan(ends[i], ends[i + 1] - ends[i])));
    return needed;
}

double scale_for_quarters_and(std::size_t loaded, std::span<Ratio> ratios) {
    const double of_loaded = scale_for_quarters(ratios.first(loaded));
    return std::max(of_loaded, scale_for_quarters(ratios));
}

// Returns the root mean square of the errors of the group in which it is largest, in units of their shape.
double worst_group(const std::vector<Error>& errors, const Shape& shape) {
    std::map<std::size_t, std::pair<double, std::size_t>> squares;
    for (const Error& error : errors) {
        auto& [sum, n] = squares[error.group];
        sum += std::pow(error.size / size(error, shape), 2);
        ++n;
    }
    double worst = 0;
    for (const auto& [group, sum] : squares)
        if (sum.second >= kRowsOfAGroup) worst = std::max(worst, std::sqrt(sum.first / double(sum.second)));
    return worst;
}

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
        // The standard deviation holds with the zero of the calibration, and after a tare.
        // Loaded rows come first.
        std::vector<Error> errors, tared;
        std::size_t loaded = 0;
        for (const std::size_t k : order)
            if (const double error = rows[k].estimated_S[c] - rows[k].row->wrench_S[c];
                std::isfinite(error) && states_sd(k)) {
                errors.push_back({std::pow(rows[k].estimated_S[c] / full_scale, 2),
                                  std::pow(load_of(rows[k].estimated_S, calibration), 2),
                                  std::pow(distance.at(validation.rows[k].row), 2), std::abs(error), validation.group[k]});
                tared.push_back(errors.back());
                loaded += is_loaded(k) ? 1 : 0;
                const auto at_rest = validation.at_rest.find(rows[k].row->session);
                if (at_rest != validation.at_rest.end() && std::isfinite(at_rest->second[c]) && validation.drifted.empty())
                    tared.back().size = std::abs(error - at_rest->second[c]);
            }
        if (errors.size() < kTails[0].errors) return clear();
        // The load of a single component is the component.
        std::vector<std::pair<double, double>> slopes;
        for (const double load : kLoadSlopes)
            for (const double slope : kSlopes)
                if (load == 0 || calibration.components.size() > 1) slopes.emplace_back(slope, load);
        // The shape with the smallest valid standard deviations, in the geometric mean over the rows.
        Shape best;
        double scale = 0, min = std::numeric_limits<double>::infinity();
        for (const double unloading : kUnloadings) {
            if (unloading > 0 && !takes_unloading) break;
            const double needed_gain = unloading > 0 && best.unloading == 0 ? kWorth : 1;
            for (const auto& [slope, load] : slopes) {
                const Shape other{slope, load, unloading};
                std::vector<Ratio> ratios = ratios_of(errors, other), ratios_tared = ratios_of(tared, other);
                double log_size = 0;
                for (const Ratio& each : ratios) log_size += std::log(each.size) / double(errors.size());
                const double largest = needed_gain * min / std::exp(log_size);  // s of a better shape is below this
                double needed = std::max(scale_for_all_and(loaded, ratios), scale_for_all_and(loaded, ratios_tared));
                if (validation.by_sessions)
                    needed = std::max({needed, worst_group(errors, other), worst_group(tared, other)});
                // A slope alone is too small where the component is 0 under a load of the others.
                const bool depends_on_others = slope > 0 && calibration.components.size() > 1;
                if (needed < largest && (depends_on_others || load > 0 || unloading > 0)) {
                    // Computed again, because scale_for() has changed the order: loaded rows first.
                    ratios = ratios_of(errors, other), ratios_tared = ratios_of(tared, other);
                    needed = std::max(
                        {needed, scale_for_quarters_and(loaded, ratios), scale_for_quarters_and(loaded, ratios_tared)});
                }
                if (!(needed < largest)) continue;
                min = needed * std::exp(log_size);
                best = other;
                scale = needed;
            }
        }
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
