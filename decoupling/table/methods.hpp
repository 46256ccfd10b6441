// The parts that the methods of model "table" share. See decoupling/table/README.md.
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

// Noise assumed where the calibration states none: 0.5 % of what an inner gauge reads at 1 N.
inline constexpr double kDefaultNoise_per_reading = 0.005;

// `noise` of every method; 0 stands for a calibration that states none.
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

// The fault of channels and components, "" where there is none. `seen`: the components that the method sees. `inner_four`:
// the method needs R1 R3 R5 R7. setup
std::string fault_of_gauges(const Calibration& calibration, std::span<const std::string_view> seen, bool inner_four = true);
// The same for a method that starts from kLinearParameters: with outer gauges, tangential_outer must be above 0. setup
std::string fault_of_linear(const CalibrationData& data);
// Bit k: channel k is one of R1 R3 R5 R7. setup
std::uint32_t inner_gauges(const Calibration& calibration);
// A row a channel: dR/R0 per N of Fx, Fy and N = -Fz, by the sign table and the four gains. setup
NumberRows gains_of_signs(const CalibrationData& data);
// Fx, Fy and N from these gains, weighed by the calibration's noise; none, with `fault` set, where they do not tell them.
// setup
std::optional<GaugeSolver> solver_of_signs(const CalibrationData& data, std::string& fault);

}  // namespace tactiled
