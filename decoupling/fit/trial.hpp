// One method on its way from the fit of all rows to a calibration with its uncertainty.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/validate.hpp"

namespace tactiled {

struct Trial {
    const FitEntry* method;
    Calibration start;        // what the fit is told
    Calibration calibration;  // fitted to all rows that count
    std::vector<std::string> warnings;
    Validation validation;
    MethodReport about;
};

// The calibration before a fit: what all methods have in common, and what this one is told.
Calibration start_of(const FitEntry& method, const FitRequest& request, const FitReport& report);

// Fits `rows`; of `warnings` those of the last fit stay. setup: throws Undetermined
Calibration fit_rows(const FitEntry& method, const Calibration& start, const Rows& rows, const std::vector<double>& drift,
                     std::vector<std::string>& warnings);

// Validation, uncertainty and held-out error of the trial's calibration. setup: throws Undetermined where the method does
// not gain what it must
void validate(const Labelled& labelled, const Rows& rows, const ZeroDrift& drift, const FitReport& report, Trial& trial);

}  // namespace tactiled
