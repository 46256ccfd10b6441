// The parts that the fits of model "table" share.
#pragma once
#include "decoupling/fit/fit.hpp"

namespace tactiled {

bool is_gauge(std::string_view name);
inline constexpr KnownChannels kGauge{is_gauge, "a gauge of model \"table\" (R1 .. R8)", "dR/R0"};

// Fits gains, zeros and noise of method "linear", from which the fit of "nonlinear" starts. setup: throws
// Undetermined
void fit_table_linear(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// Returns the decoupler that the loop makes of the calibration. setup: throws Undetermined where there is none
std::unique_ptr<Decoupler> decoupler_of_fit(const Calibration& calibration, std::string_view method);

// Puts the table `influence` and the gauge_factor of the calibration file `path` (the installed one is
// calibration/table_influence.toml) into `fit`. setup: throws SetupError where the file has none
void add_influence(const std::string& path, Fit& fit);

}  // namespace tactiled
