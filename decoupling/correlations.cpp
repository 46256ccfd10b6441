#include "decoupling/correlations.hpp"

#include <algorithm>
#include <string>

#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

// FNV-1a; never 0.
std::uint32_t number_of(const std::string& text) {
    std::uint32_t hash = 2166136261u;
    for (const char each : text) hash = (hash ^ std::uint8_t(each)) * 16777619u;
    return std::max(hash, 1u);
}

}  // namespace

Correlations correlations_of(const Calibration& calibration) {
    Correlations result;
    const std::size_t n = calibration.components.size();
    for (std::size_t i = 0, k = 0; i < n; ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        if (i < calibration.full_scale.size() && calibration.full_scale[i] > 0)
            result.full_scale[c] = calibration.full_scale[i];
        for (std::size_t j = i + 1; j < n; ++j, ++k) {
            const std::size_t d = component_index(calibration.components[j]);
            if (k < calibration.correlation.size())
                result.between[Correlations::index(std::min(c, d), std::max(c, d))] = float(calibration.correlation[k]);
        }
    }
    result.model = number_of(calibration.model);
    if (calibration.alike.size() == 2) {
        result.alike = float(calibration.alike[0]);
        result.alike_within = float(calibration.alike[1]);
    }
    return result;
}

}  // namespace tactiled
