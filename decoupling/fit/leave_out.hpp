// Decides by held-out errors which suspected labels are omitted from the fit.
#pragma once
#include "decoupling/fit/outliers.hpp"
#include "decoupling/fit/validate.hpp"

namespace tactiled {

// Fits without each held-out part, with and without the suspected rows that `judged` leaves out, and compares the errors on
// all rows. Labels of a component whose error is not lower without these rows are used; the others become NaN in `labelled`,
// and rows without a label leave `rows`. Updates the suspects and the calibration. Without a validation `judged` is adopted.
// setup: throws what `refit` throws
void leave_out(Labelled& labelled, Rows& rows, const FitEntry& method, const ZeroDrift& drift, const Refit& refit,
               LabelsJudged& judged);

}  // namespace tactiled
