// The common checks and gains of the methods of model "table".
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "decoupling/table/methods.hpp"
#include "decoupling/table/sign_table.hpp"
#include "decoupling/temperature.hpp"

namespace tactiled {

std::string fault_of_gauges(const Calibration& calibration, std::span<const std::string_view> seen, bool inner_four) {
    std::uint32_t wired = 0;
    for (const auto& name : calibration.channels) {
        const auto gauge = table_gauge(name);
        if (!gauge) return fmt::format("channel \"{}\"; a table sensor has R1 .. R8", name);
        if ((wired >> gauge->number & 1u) != 0) return fmt::format("channel \"{}\" twice", name);
        wired |= 1u << gauge->number;
    }
    for (const int inner : {1, 3, 5, 7})
        if (inner_four && (wired >> inner & 1u) == 0)
            return fmt::format("channels lacks R{}; needed are R1 R3 R5 R7", inner);
    for (const auto& name : calibration.components)
        if (std::find(seen.begin(), seen.end(), name) == seen.end())
            return fmt::format("component \"{}\"; the method measures {}", name, fmt::join(seen, " "));
    return "";
}

std::string fault_of_linear(const CalibrationData& data) {
    if (std::string fault = fault_of_gauges(data.calibration(), kForces); !fault.empty()) return fault;
    if (data.calibration().channels.size() > 4 && !(data["tangential_outer"] > 0))
        return "parameter tangential_outer (1/N, dR/R0 at 1 N) is missing or 0";
    return "";
}

std::uint32_t inner_gauges(const Calibration& calibration) {
    std::uint32_t inner = 0;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k)
        if (table_gauge(calibration.channels[k])->inner) inner |= 1u << k;
    return inner;
}

NumberRows gains_of_signs(const CalibrationData& data) {
    NumberRows gains;
    for (const auto& name : data.calibration().channels) {
        const TableGauge gauge = *table_gauge(name);
        const double tangential = data[gauge.inner ? "tangential_inner" : "tangential_outer"];
        const double normal = data[gauge.inner ? "normal_inner" : "normal_outer"];
        gains.push_back({gauge.along_x * tangential, gauge.along_y * tangential, normal});
    }
    return gains;
}

std::optional<GaugeSolver> solver_of_signs(const CalibrationData& data, std::string& fault) {
    const std::size_t n = data.calibration().channels.size();
    const double noise = data.has("noise") ? data["noise"] : kDefaultNoise_per_reading * data["normal_inner"];
    if (!(noise > 0)) {
        fault = "parameter noise (one standard deviation of a gauge, channel_unit) is not above 0";
        return std::nullopt;
    }
    // N comes from the inner gauges only (the outer ones read about 0 under a press), and two of them could not
    // distinguish a press from a bent plate.
    GaugeSolver solver(gains_of_signs(data), std::vector<double>(n, noise), data.calibration().zero,
                       inner_gauges(data.calibration()), 3);
    if (!solver.solvable((1u << n) - 1)) {
        fault = "these gains do not determine the three forces";
        return std::nullopt;
    }
    return solver;
}

namespace {

// Handbook values: 1e-4 /K of Ni-Cr, and a gauge factor of 2 times 32 ppm/K by which SU-8 expands more than polyimide.
// The modulus of polyimide.
const TemperatureEffect effect{.name = "table", .zero_per_K = 1.64e-4, .channel_unit = "dR/R0", .gain_per_K = 5e-4};

}  // namespace

}  // namespace tactiled
