#include "decoupling/fit/error_shape.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <utility>

namespace tactiled {
namespace {

// Shares of normal errors, and the corresponding number of standard deviations.
struct Tail {
    double share, sds;
};
constexpr Tail kWithinOne{0.6827, 1};
// The last one is for single loads: of few, chance leaves none so far off.
constexpr Tail kTails[] = {kWithinOne, {0.95, 1.96}, {0.99, 2.576}, {0.99999, 4.417}};
constexpr double kSure = 3.5;              // standard errors: a smaller difference may be chance
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

// An error in units of its standard deviation, the square of its load, and its weight.
struct Ratio {
    double ratio, load_squared, weight;
};

double loads_of(std::span<const Ratio> ratios) {
    double loads = 0;
    for (const Ratio& each : ratios) loads += each.weight;
    return loads;
}

// Returns the factor of the standard deviations below which so many loads are. `ratios` are in order.
double scale_at(std::span<const Ratio> ratios, double loads, const Tail& tail) {
    double below = 0;
    std::size_t at = 0;
    while (at + 1 < ratios.size() && below + ratios[at].weight < loads) below += ratios[at++].weight;
    return ratios[at].ratio / tail.sds;
}

// Returns `scale`, or the factor that has the share of each tail beyond it, if more loads are there than by chance.
double not_contradicted(double scale, std::span<Ratio> ratios) {
    std::sort(ratios.begin(), ratios.end(), [](const Ratio& a, const Ratio& b) { return a.ratio < b.ratio; });
    const double loads = loads_of(ratios);
    double needed = scale;
    for (const Tail& tail : kTails) {
        const double expected = tail.share * loads, chance = kSure * std::sqrt(expected * (1 - tail.share));
        if (expected > chance && scale_at(ratios, expected - chance, tail) > scale)
            needed = std::max(needed, scale_at(ratios, expected, tail));
    }
    return needed;
}

// Returns the factor with 68.27 % of the loads within one standard deviation, or a larger one if the tails contradict it, or
// a quarter of the errors from the smallest to the largest load: errors under light loads are few among all.
double scale_for(const std::vector<Error>& errors, const Parts& parts) {
    std::vector<Ratio> ratios;
    for (const Error& error : errors)
        ratios.push_back({error.size / std::sqrt(variance(error, parts)), error.square[kLoad], error.weight});
    std::vector<Ratio> by_load = ratios;
    std::stable_sort(by_load.begin(), by_load.end(),
                     [](const Ratio& a, const Ratio& b) { return a.load_squared < b.load_squared; });
    std::sort(ratios.begin(), ratios.end(), [](const Ratio& a, const Ratio& b) { return a.ratio < b.ratio; });
    const double of_all = scale_at(ratios, kWithinOne.share * loads_of(ratios), kWithinOne);
    double needed = not_contradicted(of_all, ratios);
    for (std::size_t i = 0, n = by_load.size(); i < 4; ++i)
        needed = std::max(needed, not_contradicted(of_all, {&by_load[i * n / 4], (i + 1) * n / 4 - i * n / 4}));
    return needed;
}

// Returns the root mean square of the errors of the group in which it is largest, in units of their standard deviation.
double worst_group(const std::vector<Error>& errors, const Parts& parts) {
    struct Sum {
        double squares = 0, loads = 0;
        std::size_t rows = 0;
    };
    std::map<std::size_t, Sum> sums;
    for (const Error& error : errors) {
        Sum& sum = sums[error.group];
        sum.squares += error.weight * error.size * error.size / variance(error, parts);
        sum.loads += error.weight;
        ++sum.rows;
    }
    double worst = 0;
    for (const auto& [group, sum] : sums)
        if (sum.rows >= kRowsOfAGroup) worst = std::max(worst, std::sqrt(sum.squares / sum.loads));
    return worst;
}

}  // namespace

Parts variance_of(const Errors& errors, bool by_sessions, const Allowed& allowed) {
    Parts parts = likeliest(errors, allowed);
    if (!(parts[kConstant] > 0)) return {};
    double scale = 0;
    for (const auto* of : {&errors.plain, &errors.tared}) {
        scale = std::max(scale, scale_for(*of, parts));
        if (by_sessions) scale = std::max(scale, worst_group(*of, parts));
    }
    for (double& part : parts) part *= scale * scale;
    return parts;
}

}  // namespace tactiled
