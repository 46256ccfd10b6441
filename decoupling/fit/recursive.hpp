// Recursive least squares with forgetting: row i of N has the weight forget^(N - i), so the newest rows dominate. For
// `calibrate --forget`.
#pragma once
#include <Eigen/Dense>

namespace tactiled {

// In square-root form: R'R = sum of forget^(N - i) x_i' x_i, R upper triangular, each row added by Givens rotations.
// R'R cannot lose its definiteness, as the covariance in the textbook form does, which squares its error (Bierman
// 1977).
//
// If nothing excites a direction, R'R decays there and the textbook's gain grows without limit (wind-up). Here a
// small weight of `start` is added with each row, one coefficient after the other (after Gay 1996): a direction keeps
// at least kHold^2 of information and returns to `start` while the rows contain less than that.
class RecursiveLeastSquares {
public:
    // `forget` is 0.5 .. 1. Columns should be scaled to a mean square of about 1. setup
    RecursiveLeastSquares(const Eigen::VectorXd& start, double forget);

    void update(const Eigen::VectorXd& x, double y);
    [[nodiscard]] Eigen::VectorXd coefficient() const;

private:
    static constexpr double kHold = 1e-3;
    void turn_in(double y);  // adds row_, which it overwrites

    Eigen::VectorXd start_, row_, right_;  // R coefficient = right
    Eigen::MatrixXd r_;
    double root_;  // square root of the factor by which the weight of earlier rows decreases with each row
    double hold_;  // keeps kHold^2 per coefficient: replaces the part that is forgotten until its next addition
    Eigen::Index next_ = 0;
};

}  // namespace tactiled
