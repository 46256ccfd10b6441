// The common part of the fits of model "generic" beyond its matrix: they fit the matrix first, then a correction of
// its residuals.
#pragma once
#include <algorithm>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

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

// Returns the residuals, one column per component, in units of their root mean square. A row without a label counts as
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

// Solves (feature' feature + ridge rows I)^-1 feature' y. The ridge bounds the condition number of the features,
// whose mean square is about 1, by 1 / ridge, so that the normal equations lose no significant digit.
class Ridge {
public:
    explicit Ridge(const Eigen::MatrixXd& features);
    // Subtracts rows that a component lacks: cheaper than a Gram matrix of the others.
    void take_out(const Eigen::MatrixXd& features);
    // Solves for all columns of `feature_y` with one factorisation.
    [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& feature_y, double ridge) const;

private:
    Eigen::MatrixXd gram_;
    double rows_;
};

Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<Eigen::Index>& rows);

}  // namespace tactiled
