// Products of tall matrices with themselves, and systems of equations with such a product: most of the time of a fit with
// many features. On x86 with AVX2 they take half the time of Eigen, which is compiled for SSE2. setup: all of them
#pragma once
#include "decoupling/solve/dense.hpp"

namespace tactiled {

// Adds sign * features' features to the lower triangle of `gram`.
void add_gram(const Eigen::MatrixXd& features, double sign, Eigen::MatrixXd& gram);

// Returns x of gram * x = right for a symmetric positive definite `gram`, whose lower triangle is read: by blocked LLT, or
// by LDLT where rounding made it indefinite.
Eigen::MatrixXd solve_gram(const Eigen::MatrixXd& gram, const Eigen::MatrixXd& right);

}  // namespace tactiled
