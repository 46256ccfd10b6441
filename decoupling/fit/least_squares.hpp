// Scaled least squares that reports unknowns that the data do not determine, and the parts of fits in which rows far from
// the rest lose their weight.
#pragma once
#include <cstddef>
#include <stdexcept>
#include <vector>

#include "decoupling/solve/dense.hpp"

namespace tactiled {

// Thrown if the data do not determine the model; what() names the missing data. Setup only.
struct Undetermined : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct LeastSquares {
    Eigen::VectorXd coefficient;         // one per column of `a`; empty if `dependent` is not
    double condition = 0;                // condition number of `a` with its columns scaled to length 1
    std::vector<std::size_t> dependent;  // columns that are linearly dependent
};

// Finds the x that minimises |a x - y|, for any number of y. Each column is scaled to length 1, then QR with column pivoting
// is used, not the normal equations, which square the condition number. A column of zeros counts as dependent.
class LeastSquaresOf {
public:
    explicit LeastSquaresOf(const Eigen::MatrixXd& a);
    [[nodiscard]] LeastSquares solve(const Eigen::VectorXd& y) const;

private:
    Eigen::RowVectorXd length_;
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr_;
    LeastSquares known_;  // without its coefficients
};
LeastSquares least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& y);

// y = constant + x . coefficient, by least squares of the columns minus their means. `centre` are those means.
struct Affine {
    LeastSquares slope;
    Eigen::RowVectorXd centre;
    double constant = 0;
};
class AffineOf {
public:
    explicit AffineOf(const Eigen::MatrixXd& x);
    [[nodiscard]] Affine fit(const Eigen::VectorXd& y) const;

private:
    Eigen::RowVectorXd centre_;
    LeastSquaresOf slope_;
};
Affine affine_fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& y);

inline constexpr double kRobustSd = 1.4826;  // median of |error| to standard deviation, for normal errors
// Scale of Cauchy's loss in robust standard deviations. The first keeps 95 % of least squares' efficiency on normal errors;
// with the second, mainly spikes lose weight.
inline constexpr double kCauchyEfficient = 2.385, kCauchyOfSpikes = 4;

// Returns the median of the values, NaN for no values; the quantile at a share of 0 .. 1 of at least one value; and the
// standard deviation of normal errors with the median magnitude of `errors`. setup
double median(std::vector<double> values);
double quantile(std::vector<double> values, double share);
double robust_sd(const Eigen::VectorXd& errors);

// Returns at most `most` of the indices 0 .. n - 1 in order: one of each stretch, at places that follow no rhythm of a
// recording (rest, press, rest ...). setup
std::vector<std::size_t> some_of(std::size_t n, std::size_t most);

}  // namespace tactiled
