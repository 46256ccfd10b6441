// How wrong a calibration is on rows that it has seen, and on rows that it has not.
#pragma once
#include "decoupling/fit/fit.hpp"

namespace tactiled {

// For each component the rms error over `rows` of what the Decoupler of the loop makes of them; NaN where none has a label.
Wrench rms_error(const Calibration& calibration, const Rows& rows);

// For each component the rms error over all rows, each decoupled with a calibration that `fit_model` made without the row's
// session, or without its fifth of the time where there is only one session. NaN where a part cannot be left out. Fills
// `validation` of the report's calibration, and warnings.
Wrench held_out_rms(const Labelled& labelled, const Rows& rows, FitModel fit_model, FitReport& report);

// Names rows that disagree with all others in the report's warnings. Never drops one.
void report_outliers(const Labelled& labelled, const Rows& rows, FitReport& report);

}  // namespace tactiled
