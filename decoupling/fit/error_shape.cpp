#include "decoupling/fit/error_shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <utility>

namespace tactiled {
namespace {

constexpr double kWithinOne = 0.6827;  // share of normal errors within one standard deviation
// Other shares of normal errors, the corresponding number of standard deviations, and the minimum number of errors for a
// quantile that does not depend on a single row.
struct Tail {
    double share, sds;
    std::size_t errors;
};
constexpr Tail kTails[] = {{kWithinOne, 1, kMinErrors}, {0.95, 1.96, 40}, {0.99, 2.576, 200}};
constexpr std::size_t kRowsOfAGroup = 10;  // minimum number of rows of a group whose root mean square counts
// Slopes of Shape.
constexpr double kSlopes[] = {0, 0.5, 1, 2, 4, 8, 16, 32};
constexpr double kLoadSlopes[] = {0, 0.5, 1, 2, 4, 8};  // limited, because few rows are at rest: the sd at rest is at least
                                                        // a ninth
constexpr double kUnloadings[] = {0, 0.5, 1, 2, 4, 8};
// Unloading counts if it makes the standard deviations this much smaller: less may be chance.
constexpr double kWorth = 0.95;
// The shape is chosen by so many errors, evenly from all; its scale is that of all. The 99 % quantile of 10,000 normal
// errors has a standard error of 1.3 %.
constexpr std::size_t kMaxErrorsOfShape = 10'000;

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

// Returns true if the smallest s that is valid for all `ratios` is not below `limit`: counting is faster than sorting.
bool exceeds_limit(std::span<const Ratio> ratios, double limit) {
    for (const Tail& tail : kTails) {
        if (ratios.size() < tail.errors) continue;
        std::size_t below = 0;
        for (const Ratio& each : ratios) below += each.ratio < limit * tail.sds ? 1 : 0;
        if (double(below) <= std::ceil(tail.share * double(ratios.size()))) return true;
    }
    return false;
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
    auto at = squares.end();
    for (const Error& error : errors) {
        if (at == squares.end() || at->first != error.group) at = squares.try_emplace(error.group).first;
        at->second.first += std::pow(error.size / size(error, shape), 2);
        ++at->second.second;
    }
    double worst = 0;
    for (const auto& [group, sum] : squares)
        if (sum.second >= kRowsOfAGroup) worst = std::max(worst, std::sqrt(sum.first / double(sum.second)));
    return worst;
}

// Returns at most n errors, evenly.
Errors some_of(const Errors& all, std::size_t n) {
    if (all.plain.size() <= n) return all;
    Errors result;
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t at = i * all.plain.size() / n;
        result.plain.push_back(all.plain[at]);
        result.tared.push_back(all.tared[at]);
        result.loaded += at < all.loaded ? 1 : 0;
    }
    return result;
}

// Returns the mean logarithm of the sizes of a shape.
double log_size(const std::vector<Error>& errors, const Shape& shape) {
    constexpr std::size_t kFactors = 64;  // a size is at most 35, so that their product is finite
    double sum = 0, product = 1;
    for (std::size_t i = 0; i < errors.size(); ++i) {
        product *= size(errors[i], shape);
        if (i % kFactors != kFactors - 1 && i + 1 < errors.size()) continue;
        sum += std::log(product);
        product = 1;
    }
    return sum / double(errors.size());
}

// Errors for which a scale is valid, besides all and those under load.
struct Validity {
    bool worst_session, quarters;
};

// Returns the smallest s that is valid for the errors; at least `limit` where it is not below that.
double scale_of(const Errors& errors, const Shape& shape, const Validity& validity, double limit) {
    double needed = 0;
    const auto exceeds = [&](double scale) {
        needed = std::max(needed, scale);
        return !(needed < limit);
    };
    for (const auto* of : {&errors.plain, &errors.tared}) {
        std::vector<Ratio> ratios = ratios_of(*of, shape);
        if (exceeds_limit(ratios, limit) || exceeds_limit(std::span(ratios).first(errors.loaded), limit)) return limit;
        if (exceeds(scale_for_all_and(errors.loaded, ratios))) return needed;
    }
    for (const auto* of : {&errors.plain, &errors.tared})
        if (validity.worst_session && exceeds(worst_group(*of, shape))) return needed;
    for (const auto* of : {&errors.plain, &errors.tared}) {
        if (!validity.quarters) break;
        std::vector<Ratio> ratios = ratios_of(*of, shape);  // again, because scale_for() has changed the order
        if (exceeds(scale_for_quarters_and(errors.loaded, ratios))) return needed;
    }
    return needed;
}

// A slope alone is too small where the component is 0 under a load of the others.
Validity validity_of(const Shape& shape, bool by_sessions, std::size_t components) {
    return {.worst_session = by_sessions,
            .quarters = (shape.slope > 0 && components > 1) || shape.load > 0 || shape.unloading > 0};
}

}  // namespace

Shape best_shape(const Errors& all, bool by_sessions, std::size_t components, bool takes_unloading) {
    const Errors errors = some_of(all, kMaxErrorsOfShape);
    Shape best;
    double min = std::numeric_limits<double>::infinity();
    for (const double unloading : kUnloadings) {
        if (unloading > 0 && !takes_unloading) break;
        const double needed_gain = unloading > 0 && best.unloading == 0 ? kWorth : 1;
        for (const double load : kLoadSlopes) {
            if (load > 0 && components == 1) break;  // the load of a single component is the component
            for (const double slope : kSlopes) {
                const Shape other{slope, load, unloading};
                const double size = std::exp(log_size(errors.plain, other)), limit = needed_gain * min / size;
                const double needed = scale_of(errors, other, validity_of(other, by_sessions, components), limit);
                if (!(needed < limit)) continue;
                min = needed * size;
                best = other;
            }
        }
    }
    return best;
}

double scale_of(const Errors& errors, const Shape& shape, bool by_sessions, std::size_t components) {
    return scale_of(errors, shape, validity_of(shape, by_sessions, components), std::numeric_limits<double>::infinity());
}

}  // namespace tactiled
