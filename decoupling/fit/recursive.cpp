#include "decoupling/fit/recursive.hpp"

#include <cmath>

namespace tactiled {

RecursiveLeastSquares::RecursiveLeastSquares(const Eigen::VectorXd& start, double forget)
    : start_(start),
      row_(start.size()),
      right_(kHold * start),
      r_(kHold * Eigen::MatrixXd::Identity(start.size(), start.size())),
      root_(std::sqrt(forget)),
      hold_(kHold * std::sqrt(1 - std::pow(forget, double(start.size())))) {}

void RecursiveLeastSquares::update(const Eigen::VectorXd& x, double y) {
    r_ *= root_;
    right_ *= root_;
    row_ = x;
    turn_in(y);
    row_.setZero();
    row_[next_] = hold_;
    turn_in(hold_ * start_[next_]);
    next_ = (next_ + 1) % row_.size();
}

void RecursiveLeastSquares::turn_in(double y) {
    const Eigen::Index n = row_.size();
    for (Eigen::Index k = 0; k < n; ++k) {
        if (row_[k] == 0) continue;
        const double length = std::hypot(r_(k, k), row_[k]), c = r_(k, k) / length, s = row_[k] / length;
        for (Eigen::Index j = k; j < n; ++j) {
            const double above = r_(k, j);
            r_(k, j) = c * above + s * row_[j];
            row_[j] = c * row_[j] - s * above;
        }
        const double above = right_[k];
        right_[k] = c * above + s * y;
        y = c * y - s * above;
    }
}

Eigen::VectorXd RecursiveLeastSquares::coefficient() const { return r_.triangularView<Eigen::Upper>().solve(right_); }

}  // namespace tactiled
