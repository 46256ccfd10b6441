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

// Returns the standard deviation of each channel's zero, channel_unit: the allowed drift, and the part of the domain beyond
// the rows. If each session has its own zero, it is subtracted from the rows. setup
std::vector<double> zeros_of(const Rows& rows, const Calibration& calibration);

}  // namespace tactiled
