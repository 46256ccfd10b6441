// The zeros of the channels in each session: after mounting a sensor anew they are others.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// The zero of each session from its rows at rest, or where not every session rests, from all of its rows by channels =
// zero of the session + gains * labels; how much they scatter; and whether a zero for each session lowers the error of an
// affine map on sessions that are left out to less than 0.7 of that with one zero. A session that is left out keeps its own
// zero, as after a tare. setup
SessionZeros session_zeros(const Labelled& labelled, const Rows& rows, FitRequest::Zeros requested);

// Takes off each channel the offset of its session. Sessions without rows keep theirs.
void take_zeros_off(const SessionZeros& zeros, Labelled& labelled);

// sd of each channel's zero that the fits have to allow for: the stated one, else that of the sessions; empty: none.
ZeroDrift zero_drift_of(const FitRequest& request, const Rows& rows, const SessionZeros& zeros);

// Says how far the zeros scatter, and what follows. `domain`: of the readings as they are.
void say_zeros(const Labelled& labelled, const SessionZeros& zeros, const Calibration& domain,
               std::vector<std::string>& warnings);

}  // namespace tactiled
