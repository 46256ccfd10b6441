// Checks, before the fit, which components the labels and channels of a recording can determine.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

bool has_label(const LabelledRow& row);
// Returns true if both have the same labels, or none, of each component.
bool is_same_label(const Wrench& a, const Wrench& b);

// Returns the rows that have a label of every one of `components`, which are indices in a wrench.
Rows rows_with(const Rows& rows, const std::vector<std::size_t>& components);
// Returns the indices of components in a wrench.
std::vector<std::size_t> component_indices(const std::vector<std::string>& names);

// Return the channels, and the labels of `components`, of at least one row; one row of the matrix for each.
Eigen::MatrixXd channels_of(const Rows& rows);
Eigen::MatrixXd labels_of(const Rows& rows, const std::vector<std::size_t>& components);

// Returns the largest magnitude of each component's labels; 0 without a label.
Wrench full_scales(const Rows& rows);

// Removes channels without information: those that the method does not know, and those that never change.
// setup: throws Undetermined where none is left, or one that the method needs never changes
Labelled with_useful_channels(const Labelled& labelled, const FitEntry& method, std::vector<std::string>& warnings);

// Checks that channels and labels have a size whose square is finite, in the units that the columns name, and that no
// label is a mark for a missing value. Warns of sizes that suggest other units.
// setup: throws Undetermined
void check_numbers(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings);

// Returns "" or a remark on fz: it is never negative, although a press has fz < 0.
std::string press_without_sign(const Rows& rows);

// Checks that the labels of the components vary independently. Fills the report's part on labels.
// setup: throws Undetermined
void check_labels(const Rows& rows, FitReport& report);

}  // namespace tactiled
