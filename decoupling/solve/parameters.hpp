// The scalars of a calibration that a model reads, checked against a list.
#pragma once
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"

namespace tactiled {

struct Parameter {
    const char* name;
    const char* what;        // with the unit, for the error
    double min, max;         // both allowed
    double fallback = kNaN;  // NaN: the model needs it
};

// Sets out[i] to the parameter known[i]; returns what is wrong with the calibration's parameters, "" where nothing is.
// setup
inline std::string read_parameters(const Calibration& calibration, std::span<const Parameter> known, double* out) {
    std::vector<std::string> names;
    for (const Parameter& parameter : known) names.emplace_back(parameter.name);
    for (const auto& [name, value] : calibration.parameters) {
        if (std::find(names.begin(), names.end(), name) != names.end()) continue;
        const auto near = nearest_name(name, names);
        return fmt::format("parameter {} is unknown; {}", name,
                           near ? "did you mean " + *near + "?" : fmt::format("known are {}", fmt::join(names, " ")));
    }
    for (std::size_t i = 0; i < known.size(); ++i) {
        const auto found = calibration.parameters.find(known[i].name);
        out[i] = found == calibration.parameters.end() ? known[i].fallback : found->second;
        if (found == calibration.parameters.end() && !std::isnan(out[i])) continue;
        if (std::isnan(out[i])) return fmt::format("parameter {} is missing: {}", known[i].name, known[i].what);
        if (!(out[i] >= known[i].min && out[i] <= known[i].max))
            return fmt::format("parameter {} = {} is outside {} .. {}: {}", known[i].name, out[i], known[i].min,
                               known[i].max, known[i].what);
    }
    return "";
}

}  // namespace tactiled
