// Finds labels that cannot be right: two that were swapped, one that was mistyped, a load that moved. Decides which of
// them the fit omits.
#pragma once
#include <functional>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

struct LabelsJudged {
    Calibration calibration;        // fitted without the loads left out
    std::vector<Suspect> suspects;  // one per row
    // loads that disagree with the fit like the loads around them: not an error of a label
    std::size_t bent = 0;
    std::size_t loads = 0;  // number of loads judged
    bool too_many = false;  // more loads disagree than kMaxShareLeftOut: all are kept
};

// Fits `rows` and names the labels that disagree with the fit. Rows of one load are judged together. A load is
// suspected if its error is far beyond the tail of all errors and the loads nearest to it in the channels do not
// share the error; a shared error would be a nonlinearity of the sensor. Errors that change slowly (hysteresis,
// drift) are subtracted before, if there are such errors. The load is left out unless its error exceeds the limit
// only slightly, or the load is at the end of the range, where a nonlinearity has the same effect. `refit` fits rows.
// setup: throws what `refit` throws
using Refit = std::function<Calibration(const Rows&)>;
LabelsJudged judge_labels(const Rows& rows, const Refit& refit, bool keep);

// Returns the median over the rows of the error's magnitude, as a mean over the components, relative to full scale. A
// few wrong labels do not change it.
double median_error(const Calibration& calibration, const Rows& rows);

// Adds the result to the report's suspects and warnings.
void report_suspects(const Labelled& labelled, const LabelsJudged& judged, FitReport& report);

// Fits without each held-out part, with and without the suspected rows that `judged` leaves out, and compares the errors on
// all rows. Labels of a component whose error is not lower without these rows are used; the others become NaN in `labelled`,
// and rows without a label leave `rows`. Updates the suspects and the calibration. Without a validation `judged` is adopted.
// setup: throws what `refit` throws
void leave_out(Labelled& labelled, Rows& rows, const FitEntry& method, const ZeroDrift& drift, const Refit& refit,
               LabelsJudged& judged);

}  // namespace tactiled
