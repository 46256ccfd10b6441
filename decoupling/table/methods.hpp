// The methods of model "table" and what their files share. See decoupling/table/README.md.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/table/gauge_solver.hpp"

namespace tactiled {

// Noise assumed where the calibration states none: 0.5 % of what an inner gauge reads at 1 N.
inline constexpr double kDefaultNoise_per_reading = 0.005;
// Gains of gauges are known to this part: its share of a reading is no sign of anything.
inline constexpr double kGainErrorOfGauge = 0.01;

// nullptr where the calibration does not serve the method; `fault` says why. setup
std::unique_ptr<Decoupler> make_table_linear(const Calibration& calibration, std::string& fault);
std::unique_ptr<Decoupler> make_table_signs(const Calibration& calibration, std::string& fault);
std::unique_ptr<Decoupler> make_table_matrix(const Calibration& calibration, std::string& fault);
std::unique_ptr<Decoupler> make_table_map(const Calibration& calibration, std::string& fault);
std::unique_ptr<Decoupler> make_table_nonlinear(const Calibration& calibration, std::string& fault);

// What a method may find in a calibration of a table sensor.
struct TableNeeds {
    std::vector<std::string> parameters;  // known; those below 0 are refused, but for normal_outer
    std::vector<std::string> tables;      // known
    std::vector<std::string> components;  // that the method sees
    bool inner_four = true;               // R1 R3 R5 R7 are needed
};

// The parameters of method "linear": every method that starts from its gains knows them.
inline const std::vector<std::string> kLinearParameters{"normal_inner", "tangential_inner", "normal_outer",
                                                        "tangential_outer", "noise"};

// What is wrong, "" where nothing is. setup
std::string fault_of_table(const Calibration& calibration, const TableNeeds& needs);
// The gains of method "linear": normal_inner, tangential_inner and, with outer gauges, tangential_outer are above 0. setup
std::string fault_of_gains(const Calibration& calibration);
// `fallback` where there is none of that name. setup
double parameter_or(const Calibration& calibration, const std::string& name, double fallback);
// A row a channel: dR/R0 per N of Fx, Fy and N = -Fz, by the sign table and the four gains. setup
std::vector<std::vector<double>> gains_of_signs(const Calibration& calibration);
// Fx, Fy and N from these gains, weighed by the calibration's noise; none, with `fault` set, where they do not tell them.
// setup
std::optional<GaugeSolver> solver_of_signs(const Calibration& calibration, std::string& fault);

}  // namespace tactiled
