// Labels of another file with another clock: their time is that of the channels plus a constant, which is fitted.
#pragma once
#include <string>

#include "decoupling/fit/labelled_table.hpp"

namespace tactiled {

// Reads times and labels; the other columns are not used. Adds a fault if there is no time or no label.
// setup: throws SetupError where the file cannot be read at all
LabelledTable read_label_file(const std::string& path);

// Finds the constant for which the labels are best an affine function of the channels, with a zero for each session, and
// sets the labels of `labelled`, whose rows are those of `table`, by linear interpolation. Rows in a gap of the labels keep
// none. Returns the sentence about the constant and its uncertainty.
// setup: throws SetupError where the constant is in doubt: the channels do not follow the labels, another constant is as
// good, or parts of the recording disagree by more than the channels leave unexplained
std::string align_labels(const LabelledTable& table, const LabelledTable& labels, Labelled& labelled);

}  // namespace tactiled
