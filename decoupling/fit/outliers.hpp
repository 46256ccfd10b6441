// Finds labels that cannot be right: two that were swapped, one that was mistyped, a load that moved. Decides which of
// them the fit omits.
#pragma once
#include <functional>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

struct LabelsJudged {
    Calibration calibration;        // fitted without the loads left out
    std::vector<Suspect> suspects;  // one per row
    bool too_many = false;          // more loads disagree than kMaxShareLeftOut: all are kept
};

// Fits `rows` and names the labels that are more likely wrong than right (label_errors.hpp), of an error that matters. Rows
// of one load are judged together. Labels that are surely wrong are left out, except at the end of the range, where a bend
// of the sensor has the same effect. `refit` fits rows.
// setup: throws what `refit` throws
using Refit = std::function<Calibration(const Rows&)>;
LabelsJudged judge_labels(const Rows& rows, const Refit& refit, bool keep);

// Returns the median over the rows of the error's magnitude, as a mean over the components, relative to full scale. A
// few wrong labels do not change it.
double median_error(const Calibration& calibration, const Rows& rows);

// Adds the result to the report's suspects and warnings.
void report_suspects(const Labelled& labelled, const LabelsJudged& judged, FitReport& report);

// Removes the labels of rows that are left out, and these rows.
void leave_out(const LabelsJudged& judged, Labelled& labelled, Rows& rows);

}  // namespace tactiled
