// Least squares that forgets: row i of N counts forget^(N - i), so the newest rows decide. For `calibrate --forget`.
#pragma once
#include <Eigen/Dense>

namespace tactiled {

// In square-root form: R'R = sum of forget^(N - i) x_i' x_i, R upper triangular, each row turned into it by Givens
// rotations. R'R cannot lose its definiteness, as the covariance of the textbook's form does, whose error it squares
// (Bierman 1977).
//
// If nothing excites a direction, R'R decays there and the textbook's gain grows without end (wind-up). Here a little of
// `start` is turned in with each row, one coefficient after the other (after Gay 1996): a direction keeps at least kHold^2
// of information, and goes back to `start` while the rows say less than that.
class RecursiveLeastSquares {
public:
    // `forget` 0.5 .. 1. Columns should be scaled to a mean square of about 1. setup
    RecursiveLeastSquares(const Eigen::VectorXd& start, double forget);

    void update(const Eigen::VectorXd& x, double y);
    [[nodiscard]] Eigen::VectorXd coefficient() const;

private:
    static constexpr double kHold = 1e-3;
    void turn_in(double y);  // row_, which it uses up

    Eigen::VectorXd start_, row_, right_;  // R coefficient = right
    Eigen::MatrixXd r_;
    double root_;  // of forget
    double hold_;  // kHold^2 a coefficient, balanced by what is forgotten until its turn comes again
    Eigen::Index next_ = 0;
};

}  // namespace tactiled
