// The common part of the fits of model "generic" beyond its matrix: they fit the matrix first, then a correction of
// its residuals.
#pragma once
#include <algorithm>
#include <functional>
#include <span>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// ---- corrections.cpp ----

// Rows that have a label of one component, and the residual of the matrix.
struct Leftover {
    std::vector<Eigen::Index> rows;  // row indices of Scaled::u
    Eigen::VectorXd y;               // N or Nm
};

struct Scaled {
    Eigen::MatrixXd u;                // rows x channels: (channel - zero) / width
    std::vector<Leftover> component;  // in the order of the calibration
};

// Fits the matrix, sets table `width` (the standard deviation of each channel) and returns the residuals.
// setup: throws Undetermined
Scaled fit_matrix_and_scale(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// Returns the unit of a component in units_left(): the root of the sum of its squared residuals.
double unit_of(const Leftover& leftover);
// Returns the residuals, one column per component, in units of unit_of(). A row without a label counts as
// explained, which affects only a search.
Eigen::MatrixXd units_left(const Scaled& scaled);

// Returns (1, u_1 .. u_n, u_1 u_1, u_1 u_2 .. u_n u_n) for each row.
Eigen::MatrixXd quadratic_features(const Eigen::MatrixXd& u);

// Calls f(first row, features_of(rows of `u`)) for each chunk of the rows begin .. end: features take much memory.
template <class MakeFeatures, class F>
void for_each_chunk(const Eigen::MatrixXd& u, Eigen::Index begin, Eigen::Index end, const MakeFeatures& features_of,
                    const F& f) {
    constexpr Eigen::Index kChunk = 2048;
    for (; begin < end; begin += kChunk) f(begin, features_of(u.middleRows(begin, std::min(kChunk, end - begin))));
}

Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<Eigen::Index>& rows);

// ---- held_out_ridge.cpp: errors of ridge regressions on rows that are left out ----

// Squared errors of one component in blocks of consecutive rows, one row per block. There is one column per ridge; the
// last column is the error without a correction.
using BlockErrors = Eigen::MatrixXd;

// Errors of one component. `as_read`: outside the domain of the other rows a correction keeps its value at the nearest point
// inside, as in the loop. `smooth`: the correction continues there, so that loads beyond all others do not hide the rest.
struct HeldOutErrors {
    BlockErrors as_read, smooth;
};

class RowSums;  // row_sums.hpp

// Leaves each session out in turn, or poses or stretches of time if the rows have one session, in at most five parts. The
// matrix and the correction are both fitted to the other rows.
// setup
std::vector<HeldOutErrors> held_out_errors(const RowSums& sums, std::span<const double> ridges);

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
