// The common parts of the methods of model "table". See decoupling/table/README.md.
#pragma once
#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "decoupling/method.hpp"
#include "decoupling/table/gauge_solver.hpp"

namespace tactiled {

// Noise assumed if the calibration states none: 0.5 % of the reading of an inner gauge at 1 N.
inline constexpr double kDefaultNoise_per_reading = 0.005;

// `noise` of every method; 0 means that the calibration states none.
inline constexpr Parameter kGaugeNoise{"noise", "one standard deviation of a gauge, channel_unit", kAboveZero, kLargest, 0};

// The parameters of method "linear", which the methods that start from its gains read as well.
inline constexpr std::array<Parameter, 5> kLinearParameters{
    {{"normal_inner", "1/N, dR/R0 of an inner gauge at 1 N of press", kAboveZero, kLargest},
     {"tangential_inner", "1/N, dR/R0 of an inner gauge at 1 N along it", kAboveZero, kLargest},
     {"normal_outer", "1/N, dR/R0 of an outer gauge at 1 N of press", -kLargest, kLargest, 0},
     {"tangential_outer", "1/N, dR/R0 of an outer gauge at 1 N along it", 0, kLargest, 0},
     kGaugeNoise}};

inline constexpr std::array<std::string_view, 3> kForces{"fx", "fy", "fz"};
inline constexpr std::array<std::string_view, 5> kForcesAndMoments{"fx", "fy", "fz", "mx", "my"};

// Returns the fault of channels and components, "" if there is none. `seen`: the components that the method measures.
// `inner_four`: the method needs R1 R3 R5 R7. setup
std::string fault_of_gauges(const Calibration& calibration, std::span<const std::string_view> seen, bool inner_four = true);
// Returns the same for a method that starts from kLinearParameters: with outer gauges, tangential_outer must be above
// 0. setup
std::string fault_of_linear(const CalibrationData& data);
// Returns a mask: bit k is set if channel k is one of R1 R3 R5 R7. setup
std::uint32_t inner_gauges(const Calibration& calibration);
// Returns one row per channel: dR/R0 per N of Fx, Fy and N = -Fz, by the sign table and the four gains. setup
NumberRows gains_of_signs(const CalibrationData& data);
// Returns a solver of Fx, Fy and N for these gains, weighted by the calibration's noise; none, with `fault` set, if
// they do not determine them. setup
std::optional<GaugeSolver> solver_of_signs(const CalibrationData& data, std::string& fault);

}  // namespace tactiled
