// Errors of ridge regressions on rows that are left out, for methods that add a correction to the matrix.
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "decoupling/fit/corrections.hpp"

namespace tactiled {

// Squared errors of one component in blocks of consecutive rows, one row per block. There is one column per ridge; the
// last column is the error without a correction.
using BlockErrors = Eigen::MatrixXd;

// Errors of one component. `as_read`: outside the domain of the other rows a correction keeps its value at the nearest point
// inside, as in the loop. `smooth`: the correction continues there, so that loads beyond all others do not hide the rest.
struct HeldOutErrors {
    BlockErrors as_read, smooth;
};

// Returns the features of some rows of Scaled::u; the first 1 + channels are (1, u).
using FeaturesOf = std::function<Eigen::MatrixXd(const Eigen::MatrixXd& u)>;

// Leaves each session out in turn, or poses or stretches of time if `rows` has one session, in at most five parts. The
// matrix and the correction are both fitted to the other rows.
// setup
std::vector<HeldOutErrors> held_out_errors(const Rows& rows, const Scaled& scaled, const FeaturesOf& features_of,
                                           std::span<const double> ridges);

// Returns true if ridge `column` lowers the error by 5 % and by more than chance: by two standard errors of the
// differences, or of the ratios, over the blocks.
bool gains(const BlockErrors& errors, Eigen::Index column);

// Returns true if ridge `column` gains on smooth and is not worse as read, or gains as read.
bool gains(const HeldOutErrors& errors, Eigen::Index column);

// Returns the ridge with the smallest smooth error among those that are not worse as read, if it gains. Otherwise returns
// the ridge with the smallest error as read if that gains, else the last column.
std::size_t best_ridge(const HeldOutErrors& errors);

// Returns true if `table` of a calibration that is fitted again has no correction for component `i`: its row is 0.
bool has_no_correction(const Calibration& calibration, const char* table, std::size_t i);

}  // namespace tactiled
