// Computes the joint domain of a calibration from its rows (decoupling/joint_domain.hpp).
#pragma once
#include <cstddef>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Sets `calibration.joint_domain`; it stays empty with one channel, or with fewer than kRowsPerCoefficient rows per
// coefficient. `group_of_row`: rows of one group are similar (a session, a stretch of time). Each group is held out
// in turn. The limit is 1.1 times the distance that 99.9 % of the held-out rows do not exceed, at least that of noise
// of 0.25 % of each range, and leaves room for full scale in all components at once. Sets the curved
// domain, too (curved_domain_fit.hpp). setup
void set_joint_domain(const Rows& rows, const std::vector<std::size_t>& group_of_row, Calibration& calibration);

// The zeros that each channel may have, as a standard deviation in channel_unit: the drift that is allowed for, and what
// the domain has beyond the rows, which are less their session's zero where each session has its own. setup
std::vector<double> zeros_of(const Rows& rows, const Calibration& calibration);

}  // namespace tactiled
