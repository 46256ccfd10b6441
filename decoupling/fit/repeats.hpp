// The repetition of numbers while the load is held, from the rows of a calibration.
#pragma once
#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Evaluates stretches of 20 or more consecutive rows of the file under one load. The result is unknown if they have fewer
// than 200 rows together, because averaged or moving loads do not show how a reading at rest repeats. setup
Repeats repeats_of(const Rows& rows);

}  // namespace tactiled
