#include "decoupling/solve/dense.hpp"

#include <Eigen/Eigenvalues>

template class Eigen::JacobiSVD<Eigen::MatrixXd>;
template class Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;

namespace tactiled::dense {

Eigen::MatrixXd solve_by_qr(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) { return a.colPivHouseholderQr().solve(b); }

Eigen::MatrixXd solve_by_ldlt(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    return a.selfadjointView<Eigen::Lower>().ldlt().solve(b);
}

Eigen::MatrixXd solve_by_llt(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    const Eigen::LLT<Eigen::MatrixXd> llt(a);
    return llt.info() == Eigen::Success ? Eigen::MatrixXd(llt.solve(b)) : solve_by_ldlt(a, b);
}

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
