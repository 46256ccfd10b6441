// The repetition of numbers while the load is held, from the rows of a calibration.
#pragma once
#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Looks at stretches of 20 or more rows that follow each other in the file under one load. Unknown where these are fewer
// than 200 rows together: loads that were averaged, or that move all the time, do not tell how a reading at rest repeats.
// setup
Repeats repeats_of(const Rows& rows);

}  // namespace tactiled
