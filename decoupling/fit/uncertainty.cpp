// Computes the standard deviation that a calibration states, from the errors on rows that it had not used.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kWithinOne = 0.6827;  // share of normal errors within one standard deviation
// Other shares of normal errors, the corresponding number of standard deviations, and the number of errors from which
// on the quantile does not depend on a single row.
struct Tail {
    double share, sds;
    std::size_t errors;
};
constexpr Tail kTails[] = {{kWithinOne, 1, 8}, {0.95, 1.96, 40}, {0.99, 2.576, 200}};
constexpr std::size_t kRowsOfAGroup = 10;  // number of rows from which on the root mean square of a group counts
// Slopes of an error that grows with the load: its standard deviation is s hypot(1, slope |estimate| / full scale).
constexpr double kSlopes[] = {0, 0.5, 1, 2, 4, 8, 16, 32};

struct Error {
    double share;  // |estimate| / full scale
    double size;
    std::size_t group;
};

double shape(const Error& error, double slope) { return std::hypot(1, slope * error.share); }

// Returns, for a slope, the value of s that has `tail.share` of the errors within `tail.sds` standard deviations.
double scale_for(const std::vector<Error>& errors, double slope, const Tail& tail) {
    std::vector<double> ratio;
    for (const Error& error : errors) ratio.push_back(error.size / shape(error, slope));
    const auto at = std::min(ratio.size() - 1, std::size_t(std::ceil(tail.share * double(ratio.size()))));
    std::nth_element(ratio.begin(), ratio.begin() + std::ptrdiff_t(at), ratio.end());
    return ratio[at] / tail.sds;
}

// Returns the root mean square of the errors of the group in which it is largest, in units of their shape.
double worst_group(const std::vector<Error>& errors, double slope) {
    std::map<std::size_t, std::pair<double, std::size_t>> squares;
    for (const Error& error : errors) {
        auto& [sum, n] = squares[error.group];
        sum += std::pow(error.size / shape(error, slope), 2);
        ++n;
    }
    double worst = 0;
    for (const auto& [group, sum] : squares)
        if (sum.second >= kRowsOfAGroup) worst = std::max(worst, std::sqrt(sum.first / double(sum.second)));
    return worst;
}

// Student's quantile over the normal one, at one standard deviation: the series of Fisher and Cornish, three terms.
double student(double freedom) {
    return 1 + 1 / (2 * freedom) + 1 / (4 * freedom * freedom) + 1 / (16 * freedom * freedom * freedom);
}

// Returns the number of loads minus the number of coefficients, at least 2.
double freedom_of(const Validation& validation, std::size_t c, const Calibration& calibration) {
    Rows rows;
    for (const auto& held_out : validation.rows)
        if (std::isfinite(held_out.row->wrench_S[c])) rows.push_back(held_out.row);
    std::sort(rows.begin(), rows.end(), [](const LabelledRow* a, const LabelledRow* b) { return a->line < b->line; });
    return std::max(2.0, double(loads_of(rows).back() + 1) - double(calibration.channels.size() + 1));
}

}  // namespace

void set_uncertainty(const Validation& validation, Calibration& calibration) {
    const std::vector<HeldOut>& rows = validation.drifted.empty() ? validation.rows : validation.drifted;
    calibration.sd.clear();
    calibration.sd_slope.clear();
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        const double full_scale = calibration.full_scale[i];
        std::vector<Error> errors;
        for (std::size_t k = 0; k < rows.size(); ++k)
            if (const double error = rows[k].estimated_S[c] - rows[k].row->wrench_S[c]; std::isfinite(error))
                errors.push_back({std::abs(rows[k].estimated_S[c]) / full_scale, std::abs(error), validation.group[k]});
        if (errors.size() < kTails[0].errors) {
            calibration.sd.clear();
            calibration.sd_slope.clear();
            return;
        }
        // The slope with the smallest valid standard deviations, in the geometric mean over the rows.
        double slope = 0, scale = 0, min = std::numeric_limits<double>::infinity();
        for (const double other : kSlopes) {
            double needed = validation.by_sessions ? worst_group(errors, other) : 0, log_shape = 0;
            for (const Tail& tail : kTails)
                if (errors.size() >= tail.errors) needed = std::max(needed, scale_for(errors, other, tail));
            for (const Error& error : errors) log_shape += std::log(shape(error, other)) / double(errors.size());
            if (const double mean = needed * std::exp(log_shape); mean < min) {
                min = mean;
                slope = other;
                scale = needed;
            }
        }
        scale *= student(freedom_of(validation, c, calibration));
        calibration.sd.push_back(scale);
        calibration.sd_slope.push_back(scale * slope / full_scale);
    }
}

}  // namespace tactiled
