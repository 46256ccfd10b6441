// One method between the fit of all rows and a calibration with its uncertainty.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/validate.hpp"

namespace tactiled {

struct Trial {
    const FitEntry* method;
    Calibration start;        // input of the fit
    Calibration calibration;  // fitted to all rows that count
    std::vector<std::string> warnings;
    Validation validation;
    std::vector<Way> ways;
    MethodReport about;
};

// Returns the calibration before a fit: the parts common to all methods, and the input of this one.
Calibration start_of(const FitEntry& method, const FitRequest& request, const FitReport& report);

// Fits `rows`; `warnings` keeps those of the last fit. setup: throws Undetermined
Calibration fit_rows(const FitEntry& method, const Calibration& start, const Rows& rows, const std::vector<double>& drift,
                     std::vector<std::string>& warnings);

// Computes validation, uncertainty and held-out error of the trial's calibration. setup: throws Undetermined where
// the method does not reach its required gain
void validate(const Labelled& labelled, const Rows& rows, const ZeroDrift& drift, const FitReport& report, Trial& trial);

}  // namespace tactiled
