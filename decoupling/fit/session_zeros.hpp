// The zeros of the channels in each session: they change when a sensor is mounted again.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Determines the zero of each session from its rows at rest or, if not every session has some, from all of its rows by
// channels = zero of the session + gains * labels; also their scatter. A session has its own zero if that reduces the error
// of an affine map on left-out sessions to less than 0.7. A left-out session keeps its own zero, as after a tare. setup
SessionZeros session_zeros(const Labelled& labelled, const Rows& rows, FitRequest::Zeros requested);

// Subtracts the offset of the session from each channel. Sessions without rows are unchanged.
void take_zeros_off(const SessionZeros& zeros, Labelled& labelled);

// Returns the sd of each channel's zero that the fits have to allow for: the stated one, else that of the sessions;
// empty: none.
ZeroDrift zero_drift_of(const FitRequest& request, const Rows& rows, const SessionZeros& zeros);

// Reports the scatter of the zeros and its consequence. `domain`: of the original readings.
void say_zeros(const Labelled& labelled, const SessionZeros& zeros, const Calibration& domain,
               std::vector<std::string>& warnings);

}  // namespace tactiled
