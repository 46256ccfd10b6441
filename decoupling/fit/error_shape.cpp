#include "decoupling/fit/error_shape.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace tactiled {
namespace {

constexpr double kSure = 3.5;              // standard deviations: a smaller difference may be chance
constexpr std::size_t kRowsOfAGroup = 10;  // minimum number of rows of a group whose root mean square counts
// A part below this share of the variance of every row changes no standard deviation by more than 2.5 %, and is left out.
constexpr double kNoPart = 0.05;
constexpr int kSteps = 200;
// The parts are in the ratio that so many errors give, evenly from all; their size is that of all.
constexpr std::size_t kMaxErrorsOfShape = 5'000;

double variance(const Error& error, const Parts& parts) {
    double sum = 0;
    for (std::size_t k = 0; k < kParts; ++k) sum += parts[k] * error.square[k];
    return sum;
}

// A step towards the largest likelihood of normal errors over the parts that are not 0. It multiplies each part by the ratio
// of the two sides of its equation, so that none becomes negative. `before`: the mean square, which one load at rest is
// taken to have besides those of the recording, so that the constant is small only if there are rests with small errors.
void step(const Errors& errors, double before, Parts& parts) {
    Parts of_errors{2 * before / parts[kConstant] / parts[kConstant]}, of_variances{2 / parts[kConstant]};
    const std::size_t n = errors.plain.size(), used = std::min(n, kMaxErrorsOfShape);
    for (const auto* of : {&errors.plain, &errors.tared})
        for (std::size_t i = 0; i < used; ++i) {
            const Error& error = (*of)[i * n / used];
            const double inverse = 1 / variance(error, parts), weight = double(n) / double(used) * error.weight * inverse;
            const double ratio = error.size * error.size * inverse;
            for (std::size_t k = 0; k < kParts; ++k) {
                of_errors[k] += weight * error.square[k] * ratio;
                of_variances[k] += weight * error.square[k];
            }
        }
    for (std::size_t k = 0; k < kParts; ++k)
        if (of_variances[k] > 0) parts[k] *= of_errors[k] / of_variances[k];
}

double mean_square(const std::vector<Error>& errors) {
    double sum = 0, loads = 0;
    for (const Error& error : errors) sum += error.weight * error.size * error.size, loads += error.weight;
    return sum / loads;
}

// Returns the logarithm of the likelihood for normal errors, a mean of plain and tared ones, with that load at rest.
double log_likelihood(const Errors& errors, double before, const Parts& parts) {
    double sum = 2 * (std::log(parts[kConstant]) + before / parts[kConstant]);
    for (const auto* of : {&errors.plain, &errors.tared})
        for (const Error& error : *of) {
            const double of_error = variance(error, parts);
            sum += error.weight * (std::log(of_error) + error.size * error.size / of_error);
        }
    return -sum / 4;
}

// Returns the likeliest parts. Unloading is one only if it makes the errors likelier beyond chance: without it the others
// are larger.
Parts likeliest(const Errors& errors, const Allowed& allowed) {
    const double mean = (mean_square(errors.plain) + mean_square(errors.tared)) / 2;
    if (!(mean > 0)) return {};
    const auto fitted = [&](bool unloading) {
        Parts parts{mean, mean, allowed.load ? mean : 0, unloading ? mean : 0};
        for (int i = 0; i < kSteps; ++i) step(errors, mean, parts);
        return parts;
    };
    Parts parts = fitted(false);
    if (allowed.unloading) {
        const Parts other = fitted(true);
        if (log_likelihood(errors, mean, other) - log_likelihood(errors, mean, parts) > kSure * kSure / 2) parts = other;
    }
    for (const Part part : {kSlope, kLoad}) {
        double share = 0;
        for (const Error& error : errors.plain)
            share = std::max(share, parts[part] * error.square[part] / variance(error, parts));
        if (share < kNoPart) parts[part] = 0;
    }
    return parts;
}

struct Sum {
    double squares = 0, loads = 0;
    std::size_t rows = 0;
    void add(const Error& error, double square) {
        squares += error.weight * square;
        loads += error.weight;
        ++rows;
    }
    [[nodiscard]] double mean() const { return squares / loads; }
};

// Returns the factor by which the mean square of so many normal errors exceeds their variance by chance: Wilson and
// Hilferty's quantile of the chi-square distribution.
double by_chance(double loads) { return std::pow(1 - 2 / (9 * loads) + kSure * std::sqrt(2 / (9 * loads)), 3); }

// Returns the mean square of the errors in units of their variance: the largest of that of all, of each group with enough
// rows, and of each quarter of the errors from the smallest to the largest load, where that is more than chance: errors
// under light loads are few among all.
double largest_mean_square(const std::vector<Error>& errors, const Parts& parts, bool by_groups) {
    std::vector<std::size_t> by_load(errors.size());
    std::iota(by_load.begin(), by_load.end(), std::size_t{0});
    std::stable_sort(by_load.begin(), by_load.end(),
                     [&](std::size_t a, std::size_t b) { return errors[a].square[kLoad] < errors[b].square[kLoad]; });
    Sum all, quarters[4];
    std::map<std::size_t, Sum> groups;
    for (std::size_t i = 0; i < errors.size(); ++i) {
        const Error& error = errors[by_load[i]];
        const double square = error.size * error.size / variance(error, parts);
        all.add(error, square);
        quarters[4 * i / errors.size()].add(error, square);
        if (by_groups) groups[error.group].add(error, square);
    }
    double largest = all.mean();
    for (const Sum& quarter : quarters)
        if (quarter.mean() > by_chance(quarter.loads)) largest = std::max(largest, quarter.mean());
    for (const auto& [group, sum] : groups)
        if (sum.rows >= kRowsOfAGroup) largest = std::max(largest, sum.mean());
    return largest;
}

}  // namespace

Parts variance_of(const Errors& errors, bool by_sessions, const Allowed& allowed) {
    Parts parts = likeliest(errors, allowed);
    if (!(parts[kConstant] > 0)) return {};
    const double larger = std::max(
        {1.0, largest_mean_square(errors.plain, parts, by_sessions), largest_mean_square(errors.tared, parts, by_sessions)});
    for (double& part : parts) part *= larger;
    return parts;
}

}  // namespace tactiled
