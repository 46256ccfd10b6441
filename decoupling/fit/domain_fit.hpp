// The checks of the channels against each other, computed from the rows of a calibration.
#pragma once
#include <cstddef>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// ---- joint_domain_fit.cpp: decoupling/joint_domain.hpp ----

// Sets `calibration.joint_domain`; it stays empty with one channel, or with fewer than kRowsPerCoefficient rows per
// coefficient. `group_of_row`: rows of one group are similar (a session, a stretch of time). Each group is held out
// in turn. The limit is 1.1 times the distance that 99.9 % of the held-out rows do not exceed, at least that of noise
// of 0.25 % of each range, and leaves room for full scale in all components at once. Sets the curved
// domain, too. setup
void set_joint_domain(const Rows& rows, const std::vector<std::size_t>& group_of_row, Calibration& calibration);

// Returns the standard deviation of each channel's zero, channel_unit: the allowed drift, and the part of the domain beyond
// the rows. If each session has its own zero, it is subtracted from the rows. setup
std::vector<double> zeros_of(const Rows& rows, const Calibration& calibration);

// ---- curved_domain_fit.cpp: decoupling/curved_distance.hpp ----

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

// ---- parity_fit.cpp: decoupling/parity.hpp ----

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
