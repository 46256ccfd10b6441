// The joint domain of a calibration from its rows (decoupling/joint_domain.hpp).
#pragma once
#include <cstddef>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Sets `calibration.joint_domain`, or leaves it empty where there is one channel or fewer than
// kRowsPerCoefficient rows for each coefficient. `group_of_row`: rows of one group resemble each other (a session, a stretch
// of time); each group is held out in turn, and the limit is 1.1 times the distance that 99.9 % of the held-out rows do not
// exceed, at least that of noise of 0.25 % of each range, with room for full scale in all components at once. setup
void set_joint_domain(const Rows& rows, const std::vector<std::size_t>& group_of_row, Calibration& calibration);

// The zeros that each channel may have, as a standard deviation in channel_unit: the drift that is allowed for, and what
// the domain has beyond the rows, which are less their session's zero where each session has its own. setup
std::vector<double> zeros_of(const Rows& rows, const Calibration& calibration);

}  // namespace tactiled
