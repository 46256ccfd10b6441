// Eigen's decompositions of matrices of any size, compiled once, in dense.cpp: each file that instantiates them takes
// 10 s longer to compile.
// setup: all of them allocate
#pragma once
#include <Eigen/Dense>
#include <optional>

extern template class Eigen::JacobiSVD<Eigen::MatrixXd>;
extern template class Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;
extern template class Eigen::HouseholderQR<Eigen::MatrixXd>;
extern template class Eigen::PartialPivLU<Eigen::MatrixXd>;

namespace tactiled::dense {

// Returns x of a * x = b with the least |a * x - b|, by QR with column pivoting. a: n x m, b: n x k, x: m x k.
Eigen::MatrixXd solve_by_qr(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// Returns x of a * x = b for a symmetric positive definite `a` (m x m), whose lower triangle is read. b and x: m x k.
Eigen::MatrixXd solve_by_ldlt(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// The same in blocks, 4 to 7 times faster for m above 100; by LDLT where rounding made `a` indefinite.
Eigen::MatrixXd solve_by_llt(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// Returns x of a * x = b by the blocked LLT decomposition, or nothing if `a` (m x m, lower triangle) is not positive
// definite.
std::optional<Eigen::VectorXd> try_solve_by_llt(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

// Returns x with the least |x| among those with the least |a * x - b|. a: n x m of any rank, b: n x k, x: m x k.
Eigen::MatrixXd least_norm(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
Eigen::VectorXd least_norm_of_one(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

// Returns the lower triangle L of the positive definite a = L * L', m x m.
Eigen::MatrixXd lower_factor(const Eigen::MatrixXd& a);

// Returns x of L * x = b for a lower triangle L (m x m); b and x: m x k.
Eigen::MatrixXd solve_lower(const Eigen::MatrixXd& lower, const Eigen::MatrixXd& b);

// Eigenvalues in ascending order, and the eigenvectors as columns, of the symmetric matrix `a`, whose lower triangle is
// read.
struct SymmetricEigen {
    Eigen::VectorXd values;
    Eigen::MatrixXd vectors;
};
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& a);

// Returns the inverse of the regular matrix `a`, m x m.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& a);

// Returns R (m x m, upper triangle, zeros below) of a QR decomposition of `a` (n x m): a' * a = R' * R.
Eigen::MatrixXd triangle_of(const Eigen::MatrixXd& a);

// Returns the largest magnitude of an eigenvalue of the square matrix `a`.
double spectral_radius(const Eigen::MatrixXd& a);

}  // namespace tactiled::dense
