// Fits of model "table" for its methods "matrix", "nonlinear" and "map"; of type FitModel (fit.hpp).
#pragma once
#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Method "matrix": a forward gain for each gauge and component, a zero and a noise for each gauge. Components: any of fx fy
// fz mx my that are labelled. setup: throws Undetermined
void fit_table_matrix(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// Method "nonlinear": the fit of "linear", then hysteresis and the curve of the press. The rows of one session are taken as
// one stretch of time that begins unloaded. setup: throws Undetermined
void fit_table_nonlinear(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// Method "map": a scale and a zero for each gauge, for the table `influence` that the calibration brings along (and its
// gauge_factor, 2 where it has none). The labels fx fy fz mx my say where the point was. setup: throws Undetermined
void fit_table_map(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// Those that have a label of every one of `components`.
Rows rows_with(const Rows& rows, const std::vector<std::string>& components);

// Puts the table `influence` and the gauge_factor of the calibration file `path` (the installed one is
// calibration/table_influence.toml) into `calibration`. setup: throws SetupError where the file has none
void add_influence(const std::string& path, Calibration& calibration);

}  // namespace tactiled
