// The parity of a calibration from its rows (decoupling/parity.hpp).
#pragma once
#include <cstddef>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Sets `calibration.parity`: each channel as a linear function of the others, or a quadratic one if that reduces the error
// on rows of held-out groups to less than 0.7. A channel is not checked if kLimit standard deviations of that error are more
// than a fifth of its range. `parity` stays empty if no channel can be checked, if there are too few rows, or if more than 1
// % of the held-out rows, judged with the standard deviations of the other groups and in their order, raise the alarm; only
// the last case adds a warning. setup
void set_parity(const Rows& rows, const std::vector<std::size_t>& group_of_row, Calibration& calibration,
                std::vector<std::string>& warnings);

// Sets the data of the check that depend on the calibration's method: `parity_harmless`, and `sd_without`, the error with
// one channel replaced by its prediction, rms over the rows. setup
void set_parity_of_method(const Rows& rows, Calibration& calibration);

}  // namespace tactiled
