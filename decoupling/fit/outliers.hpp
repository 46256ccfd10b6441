// Labels that cannot be right: two that were swapped, one that was mistyped, a load that moved.
#pragma once
#include <functional>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

struct LabelsJudged {
    Calibration calibration;        // fitted without those left out
    std::vector<Suspect> suspects;  // a row each
    std::size_t bent = 0;           // loads that disagree with the fit as the loads around them do: no fault of a label
    std::size_t loads = 0;          // that were judged
    bool too_many = false;          // more disagree than kMaxShareLeftOut: all stay
};

// Fits `rows` and names the labels that disagree with the fit. Rows of one load are judged together. A load is suspected
// where its error is far beyond the tail of all errors, after errors that change slowly (hysteresis, drift) have been taken
// off where the errors are of that kind, and where the loads nearest to it in the channels do not share its error: theirs
// would be a bend of the sensor. It is left out unless its error stands out by little, or its load is at the end of the
// range, where a bend looks the same.
// `refit` fits rows. setup: throws what `refit` throws
using Refit = std::function<Calibration(const Rows&)>;
LabelsJudged judge_labels(const Rows& rows, const Refit& refit, bool keep);

// Median over the rows of the error's size, mean over the components, of full scale: not moved by a few wrong labels.
double median_error(const Calibration& calibration, const Rows& rows);

// Puts what was found into the report's suspects and warnings.
void report_suspects(const Labelled& labelled, const LabelsJudged& judged, FitReport& report);

}  // namespace tactiled
