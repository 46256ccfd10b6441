// Findings in a labelled recording before the fit: mistakes, the repetition of numbers, the effect of temperature on the
// channels, and their zeros in each session.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// ---- recording_checks.cpp, session_checks.cpp: mistakes that a fit would only show as a large error ----

inline constexpr std::size_t kFewestRows = 30;  // fewer rows do not show these mistakes

// Warns of a channel that counts rows, of one that is cut off at its end, of labels that are 0 under load, of labels
// that are late, of times that go backwards or are in milliseconds, and of a recording without unloading.
// setup: throws Undetermined where a channel has a mark for missing values, and where check_sessions does
void check_recording(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings);

// Compares the labels of each session with those of the others for the same readings. Warns of sessions that contradict
// each other in part. setup: throws Undetermined where they do on the whole, or have labels in other units
void check_sessions(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings);

// ---- repeats.cpp: the repetition of numbers while the load is held ----

// Evaluates stretches of 20 or more consecutive rows of the file under one load. The result is unknown if they have fewer
// than 200 rows together, because averaged or moving loads do not show how a reading at rest repeats. setup
Repeats repeats_of(const Rows& rows);

// ---- temperature_fit.cpp: zero and gain of each channel against temperature (decoupling/temperature.hpp) ----

// Corrects each row of `labelled` to the reference temperature and returns the correction, if the rows cover at least 2 K
// and the temperature lowers the error of a quadratic forward model on held-out stretches. Otherwise returns the known
// coefficients of the model if `dummy` has a name, else none, and adds the reason to `warnings`. The standard deviations of
// fitted coefficients are those of a jackknife over the stretches. setup
Temperature take_temperature_off(const Rows& rows, Labelled& labelled, const Calibration& calibration,
                                 const Temperature& dummy, std::vector<std::string>& warnings);

// ---- session_zeros.cpp: the zeros of the channels in each session, which change when a sensor is mounted again ----

// Determines the zero of each session (mixed_effects.hpp), and their scatter. A session has its own zero if that reduces the
// error of an affine map on left-out sessions to less than 0.7. A left-out session keeps its own zero, as after a tare.
// setup
SessionZeros session_zeros(const Labelled& labelled, const Rows& rows, FitRequest::Zeros requested);

// Subtracts the offset of the session from each channel. Sessions without rows are unchanged.
void take_zeros_off(const SessionZeros& zeros, Labelled& labelled);

// Returns the sd of each channel's zero that the fits have to allow for: the stated one, else that of the sessions;
// empty: none.
ZeroDrift zero_drift_of(const FitRequest& request, const Rows& rows, const SessionZeros& zeros);

// Reports the scatter of the zeros and its consequence. `domain`: of the original readings.
void say_zeros(const Labelled& labelled, const SessionZeros& zeros, const Calibration& domain,
               std::vector<std::string>& warnings);

// ---- zero_age.cpp: how fast the zero drifts, and how far another session is from it ----

// Sets zero_rate_per_h of a calibration with its sd, if the channels move more in half a session than noise and loads
// explain, by a force of more than the sd in an hour; and zero_shift, if five sessions or more have zeros. Returns true if a
// session is long enough to show a drift. setup
bool set_zero_age(const Labelled& labelled, const Rows& rows, const SessionZeros& zeros, Calibration& calibration,
                  std::vector<std::string>& warnings);

}  // namespace tactiled
