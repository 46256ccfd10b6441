#include "decoupling/solve/dense.hpp"

#include <Eigen/Eigenvalues>

template class Eigen::JacobiSVD<Eigen::MatrixXd>;
template class Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;
template class Eigen::HouseholderQR<Eigen::MatrixXd>;
template class Eigen::PartialPivLU<Eigen::MatrixXd>;

namespace tactiled::dense {

Eigen::MatrixXd solve_by_qr(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) { return a.colPivHouseholderQr().solve(b); }

Eigen::MatrixXd solve_by_ldlt(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    return a.selfadjointView<Eigen::Lower>().ldlt().solve(b);
}

Eigen::MatrixXd solve_by_llt(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    const Eigen::LLT<Eigen::MatrixXd> llt(a);
    return llt.info() == Eigen::Success ? Eigen::MatrixXd(llt.solve(b)) : solve_by_ldlt(a, b);
}

std::optional<Eigen::VectorXd> try_solve_by_llt(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
    const Eigen::LLT<Eigen::MatrixXd> llt(a);
    if (llt.info() != Eigen::Success) return std::nullopt;
    return llt.solve(b);
}

Eigen::MatrixXd least_norm(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    return Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>(a).solve(b);
}

Eigen::VectorXd least_norm_of_one(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
    return Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>(a).solve(b);
}

Eigen::MatrixXd lower_factor(const Eigen::MatrixXd& a) { return a.llt().matrixL(); }

Eigen::MatrixXd solve_lower(const Eigen::MatrixXd& lower, const Eigen::MatrixXd& b) {
    return lower.triangularView<Eigen::Lower>().solve(b);
}

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& a) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(a);
    return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::MatrixXd inverse(const Eigen::MatrixXd& a) { return a.inverse(); }

Eigen::MatrixXd triangle_of(const Eigen::MatrixXd& a) {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(a);
    const Eigen::Index n = std::min(a.rows(), a.cols());
    Eigen::MatrixXd r = Eigen::MatrixXd::Zero(a.cols(), a.cols());
    r.topRows(n) = qr.matrixQR().topRows(n).template triangularView<Eigen::Upper>();
    return r;
}

double spectral_radius(const Eigen::MatrixXd& a) {
    return Eigen::EigenSolver<Eigen::MatrixXd>(a, false).eigenvalues().cwiseAbs().maxCoeff();
}

}  // namespace tactiled::dense
