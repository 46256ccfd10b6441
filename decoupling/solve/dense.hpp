// Eigen's decompositions of matrices of any size, compiled once, in dense.cpp: each file that instantiates them takes
// 10 s longer to compile.
// setup: all of them allocate
#pragma once
#include <Eigen/Dense>

extern template class Eigen::JacobiSVD<Eigen::MatrixXd>;
extern template class Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;

namespace tactiled::dense {

// Returns x of a * x = b with the least |a * x - b|, by QR with column pivoting. a: n x m, b: n x k, x: m x k.
Eigen::MatrixXd solve_by_qr(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// Returns x of a * x = b for a symmetric positive definite `a` (m x m), whose lower triangle is read. b and x: m x k.
Eigen::MatrixXd solve_by_ldlt(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// The same in blocks, 4 to 7 times faster for m above 100; by LDLT where rounding made `a` indefinite.
Eigen::MatrixXd solve_by_llt(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// Returns R (m x m, upper triangle, zeros below) of a QR decomposition of `a` (n x m): a' * a = R' * R.
Eigen::MatrixXd triangle_of(const Eigen::MatrixXd& a);

// Returns the largest magnitude of an eigenvalue of the square matrix `a`.
double spectral_radius(const Eigen::MatrixXd& a);

}  // namespace tactiled::dense
