// The standard deviation that a calibration states, from the errors on rows that it had not seen.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kWithinOne = 0.6827;  // of normal errors are within one standard deviation
// Of an error that grows with the load: its standard deviation is s hypot(1, slope |estimate| / full scale).
constexpr double kSlopes[] = {0, 0.5, 1, 2, 4, 8, 16, 32};

struct Error {
    double share;  // |estimate| / full scale
    double size;
};

// For a slope, the value of s that has kWithinOne of the errors within.
double scale_for(const std::vector<Error>& errors, double slope) {
    std::vector<double> ratio;
    for (const auto& [share, size] : errors) ratio.push_back(size / std::hypot(1, slope * share));
    const auto at = std::min(ratio.size() - 1, std::size_t(std::ceil(kWithinOne * double(ratio.size()))));
    std::nth_element(ratio.begin(), ratio.begin() + std::ptrdiff_t(at), ratio.end());
    return ratio[at];
}

// Misfit of a slope to the errors: they should be within one standard deviation as often where the load is small as
// where it is great. Sum over four equal parts, by load, of the squared difference from kWithinOne.
double unevenness(const std::vector<Error>& by_load, double slope, double scale) {
    double sum = 0;
    for (std::size_t part = 0; part < 4; ++part) {
        const std::size_t first = part * by_load.size() / 4, last = (part + 1) * by_load.size() / 4;
        double within = 0;
        for (std::size_t i = first; i < last; ++i)
            within += by_load[i].size <= scale * std::hypot(1, slope * by_load[i].share) ? 1 : 0;
        sum += std::pow(within / double(last - first) - kWithinOne, 2);
    }
    return sum;
}

}  // namespace

void set_uncertainty(const std::vector<HeldOut>& rows, Calibration& calibration) {
    calibration.sd.clear();
    calibration.sd_slope.clear();
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        const double full_scale = calibration.full_scale[i];
        std::vector<Error> errors;
        for (const auto& [row, estimated] : rows)
            if (const double error = estimated[c] - row->wrench_S[c]; std::isfinite(error))
                errors.push_back({std::abs(estimated[c]) / full_scale, std::abs(error)});
        if (errors.size() < 8) {
            calibration.sd.clear();
            calibration.sd_slope.clear();
            return;
        }
        std::sort(errors.begin(), errors.end(), [](const Error& a, const Error& b) { return a.share < b.share; });
        double best = 0, best_scale = scale_for(errors, 0), min = unevenness(errors, 0, best_scale);
        for (const double slope : kSlopes) {
            const double scale = scale_for(errors, slope), uneven = unevenness(errors, slope, scale);
            if (uneven >= min) continue;
            min = uneven;
            best = slope;
            best_scale = scale;
        }
        calibration.sd.push_back(best_scale);
        calibration.sd_slope.push_back(best_scale * best / full_scale);
    }
}

}  // namespace tactiled
