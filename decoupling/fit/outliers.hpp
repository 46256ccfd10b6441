// Labels that cannot be right: two that were swapped, one that was misread, a load that moved.
#pragma once
#include "decoupling/fit/fit.hpp"

namespace tactiled {

// The rows without those few whose label disagrees with the rest, whatever the sensor is: by ten robust standard
// deviations and 5 % of full scale of an affine map that was fitted with Cauchy's loss, and at most two rows or 1 %. Where
// more disagree, it is the sensor that is no straight line, and all stay. Named by file and line in the warnings.
Rows without_outliers(const Labelled& labelled, const Rows& rows, FitReport& report);

// Says which rows the finished calibration cannot explain; they are part of it nevertheless.
void report_disagreement(const Labelled& labelled, const Rows& rows, FitReport& report);

}  // namespace tactiled
