// The components that the labels and channels of a recording can determine, checked before the fit.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

bool has_label(const LabelledRow& row);

// Without the channels that say nothing: those that the method does not know, and those that never change.
// setup: throws Undetermined where none is left, or one that the method needs never changes
Labelled with_useful_channels(const Labelled& labelled, const FitEntry& method, std::vector<std::string>& warnings);

// Channels and labels must be of a size that their squares can have, in the units that the columns name.
// setup: throws Undetermined
void check_numbers(const Labelled& labelled, const Rows& rows);

// "" or what is odd about fz: it is never negative, while a press has fz < 0.
std::string press_without_sign(const Rows& rows);

// The labels of the components must vary, and not only together. Fills the report's part about labels.
// setup: throws Undetermined
void check_labels(const Rows& rows, FitReport& report);

}  // namespace tactiled
