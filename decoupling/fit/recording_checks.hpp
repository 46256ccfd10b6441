// Checks a labelled recording for mistakes that a fit would only show as a large error.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

inline constexpr std::size_t kFewestRows = 30;  // fewer rows do not show these mistakes

// Warns of a channel that counts rows, of one that is cut off at its end, of labels that are 0 under load, of labels
// that are late, of times that go backwards or are in milliseconds, and of a recording without unloading.
// setup: throws Undetermined where a channel has a mark for missing values, and where check_sessions does
void check_recording(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings);

// Compares the labels of each session with those of the others for the same readings. Warns of sessions that contradict
// each other in part. setup: throws Undetermined where they do on the whole, or have labels in other units
void check_sessions(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings);

}  // namespace tactiled
