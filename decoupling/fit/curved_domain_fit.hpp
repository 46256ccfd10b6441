// Computes the curved domain of a calibration from its rows (decoupling/curved_distance.hpp).
#pragma once
#include <cstddef>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Sets `calibration.joint_domain.curved`; the rest of the joint domain, the fit and its standard deviation are set. The
// directions are the principal components of the rows, as many as the calibration has components, or more, up to four.
// `zero_sd`: standard deviation of each channel's zero, channel_unit. Each group is held out in turn. The number of
// directions is the one that leaves the least harmful damage undetected: rows in which one channel has the value of another
// row, are GOOD and move a component by more than 10 % of full scale. The curved domain stays empty with fewer than two
// channels more than directions, with too few rows or loads, if more than 0.5 % of the held-out rows are outside, if the
// joint domain alone leaves less than 0.2 % of the damaged rows harmful, or if the curved domain finds less than 30 % of
// these. setup
void set_curved_domain(const Rows& rows, const std::vector<std::size_t>& group_of_row, const std::vector<double>& zero_sd,
                       Calibration& calibration);

}  // namespace tactiled
