// Model "table": its methods, and the checks that they share.
#include "decoupling/table/methods.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "decoupling/solve/checked.hpp"
#include "decoupling/table/sign_table.hpp"

namespace tactiled {
namespace {

// What is wrong with a name, "" where `known` has it.
std::string fault_of_name(const char* what, const std::string& name, const std::vector<std::string>& known) {
    if (std::find(known.begin(), known.end(), name) != known.end()) return "";
    const auto near = nearest_name(name, known);
    return fmt::format("{} {} is unknown; {}", what, name,
                       near            ? "did you mean " + *near + "?"
                       : known.empty() ? "the method has none"
                                       : fmt::format("known are {}", fmt::join(known, " ")));
}

std::unique_ptr<Decoupler> make(const Calibration& calibration, const std::string& method, Options& options) {
    std::string fault;
    auto decoupler = method == "signs"       ? make_table_signs(calibration, fault)
                     : method == "matrix"    ? make_table_matrix(calibration, fault)
                     : method == "map"       ? make_table_map(calibration, fault)
                     : method == "nonlinear" ? make_table_nonlinear(calibration, fault)
                                             : make_table_linear(calibration, fault);
    if (decoupler != nullptr) return decoupler;
    const bool linear = method.empty() || method == "linear";
    options.problem("calibration", calibration.path + ": " + (linear ? "" : "method " + method + ": ") + fault);
    return nullptr;
}

const DecouplerEntry entry("table", {"linear", "signs", "matrix", "map", "nonlinear"}, make);

}  // namespace

std::string fault_of_table(const Calibration& calibration, const TableNeeds& needs) {
    std::uint32_t seen = 0;
    for (const auto& name : calibration.channels) {
        const auto gauge = table_gauge(name);
        if (!gauge) return fmt::format("channel \"{}\"; a table sensor has R1 .. R8", name);
        if ((seen >> gauge->number & 1u) != 0) return fmt::format("channel \"{}\" twice", name);
        seen |= 1u << gauge->number;
    }
    for (const int inner : {1, 3, 5, 7})
        if (needs.inner_four && (seen >> inner & 1u) == 0)
            return fmt::format("channels lacks R{}; needed are R1 R3 R5 R7", inner);
    for (const auto& name : calibration.components)
        if (std::find(needs.components.begin(), needs.components.end(), name) == needs.components.end())
            return fmt::format("component \"{}\"; the method sees {}", name, fmt::join(needs.components, " "));
    for (const auto& [name, value] : calibration.parameters) {
        if (std::string fault = fault_of_name("parameter", name, needs.parameters); !fault.empty()) return fault;
        if (value < 0 && name != "normal_outer") return fmt::format("parameter {} = {} is below 0", name, value);
    }
    for (const auto& [name, rows] : calibration.tables)
        if (std::string fault = fault_of_name("table", name, needs.tables); !fault.empty()) return fault;
    return fault_of_checked(calibration);
}

std::string fault_of_gains(const Calibration& calibration) {
    std::vector<std::string> needed{"normal_inner", "tangential_inner"};
    if (calibration.channels.size() > 4) needed.emplace_back("tangential_outer");
    for (const auto& name : needed)
        if (!(parameter_or(calibration, name, 0) > 0))
            return fmt::format("parameter {} (1/N, dR/R0 at 1 N) is missing or 0", name);
    return "";
}

double parameter_or(const Calibration& calibration, const std::string& name, double fallback) {
    const auto found = calibration.parameters.find(name);
    return found == calibration.parameters.end() ? fallback : found->second;
}

std::vector<std::vector<double>> gains_of_signs(const Calibration& calibration) {
    std::vector<std::vector<double>> gains;
    for (const auto& name : calibration.channels) {
        const TableGauge gauge = *table_gauge(name);
        const double tangential = parameter_or(calibration, gauge.inner ? "tangential_inner" : "tangential_outer", 0);
        const double normal = parameter_or(calibration, gauge.inner ? "normal_inner" : "normal_outer", 0);
        gains.push_back({gauge.along_x * tangential, gauge.along_y * tangential, normal});
    }
    return gains;
}

std::optional<GaugeSolver> solver_of_signs(const Calibration& calibration, std::string& fault) {
    const std::size_t n = calibration.channels.size();
    const double noise =
        parameter_or(calibration, "noise", kDefaultNoise_per_reading * calibration.parameters.at("normal_inner"));
    if (!(noise > 0)) {
        fault = "parameter noise (one standard deviation of a gauge, channel_unit) is not above 0";
        return std::nullopt;
    }
    // N comes from the inner gauges only (the outer ones read about 0 under a press), and with two of them left nothing
    // would tell a press from a bent plate.
    std::uint32_t inner = 0;
    for (std::size_t k = 0; k < n; ++k)
        if (table_gauge(calibration.channels[k])->inner) inner |= 1u << k;
    GaugeSolver solver(gains_of_signs(calibration), std::vector<double>(n, noise), calibration.zero, inner, 3);
    if (!solver.solvable((1u << n) - 1)) {
        fault = "these gains cannot tell the three forces apart";
        return std::nullopt;
    }
    return solver;
}

}  // namespace tactiled
