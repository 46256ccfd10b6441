// The part of tactilectl calibrate that is for arrays.
#pragma once
#include <string>

#include "decoupling/fit/fit.hpp"

namespace tactiled::ctl {

struct ArraySettings {
    std::string geometry, map;
};

// Calibrates an array, writes the files and prints a report. `request` has the parameters. setup: throws SetupError
void calibrate_array(const FitEntry& entry, const FitRequest& request, const ArraySettings& settings, const std::string& in,
                     const std::string& out, bool json);

}  // namespace tactiled::ctl
