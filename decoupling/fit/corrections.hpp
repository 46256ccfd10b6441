// The common part of the fits of model "generic" beyond its matrix: the matrix first, then a correction of what it leaves
// over.
#pragma once
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Rows that have a label of one component, and what the matrix leaves over of it.
struct Leftover {
    std::vector<Eigen::Index> rows;  // of Scaled::u
    Eigen::VectorXd y;               // N or Nm
};

struct Scaled {
    Eigen::MatrixXd u;                // rows x channels: (channel - zero) / width
    std::vector<Leftover> component;  // as in the calibration
};

// Fits the matrix, sets table `width` (the standard deviation of each channel) and gives what is left over.
// setup: throws Undetermined
Scaled fit_matrix_and_scale(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// (1, u_1 .. u_n, u_1 u_1, u_1 u_2 .. u_n u_n) of each row.
Eigen::MatrixXd quadratic_features(const Eigen::MatrixXd& u);

// (feature' feature + ridge rows I)^-1 feature' y: the ridge bounds the condition number of the features, which have a
// mean square of about 1, at 1 / ridge, so that the normal equations lose no digit that noise would not.
class Ridge {
public:
    explicit Ridge(const Eigen::MatrixXd& features);
    // `feature_y` and the result have a column for each y; one factorisation serves them all.
    [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& feature_y, double ridge) const;

private:
    Eigen::MatrixXd gram_;
    double rows_;
};

// Rows of `matrix` that stand in `rows`.
Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<Eigen::Index>& rows);

}  // namespace tactiled
