#include "decoupling/fit/rbf_basis.hpp"

#include <algorithm>
#include <limits>
#include <random>

#include "decoupling/fit/corrections.hpp"

namespace tactiled {
namespace {

constexpr Eigen::Index kRowsForCentre = 5;  // rows that place a centre

}  // namespace

Eigen::MatrixXd Basis::features_of(const Eigen::MatrixXd& u) const {
    const Eigen::MatrixXd quadratic = quadratic_features(u);
    Eigen::MatrixXd features(u.rows(), quadratic.cols() + centres.rows());
    features.leftCols(quadratic.cols()) = quadratic;
    auto around = features.rightCols(centres.rows());
    around.noalias() = u * (-2 * centres.transpose());
    around.rowwise() += centres.rowwise().squaredNorm().transpose();
    around.colwise() += u.rowwise().squaredNorm();
    around = (1 + around.array().max(0) / (spread * spread)).inverse();
    return features;
}

Eigen::RowVectorXd Basis::shift_to(const Eigen::RowVectorXd& other) const { return (zero - other).cwiseQuotient(width); }

bool Basis::is_near(const Basis& other) const {
    constexpr double kRounding = 1e-9;  // centres are stored relative to the zero of each fit
    return spread == other.spread && centres.rows() == other.centres.rows() &&
           (width - other.width).cwiseAbs().maxCoeff() <= kRounding * width.maxCoeff() &&
           ((centres.rowwise() + shift_to(other.zero)) - other.centres).cwiseAbs().maxCoeff() <= kRounding;
}

Eigen::MatrixXd k_means(const Eigen::MatrixXd& all, Eigen::Index n) {
    const Eigen::Index every = std::max(Eigen::Index(1), all.rows() / (n * kRowsForCentre));
    const Eigen::MatrixXd u = all(Eigen::seq(0, Eigen::last, every), Eigen::all);
    const Eigen::VectorXd length = u.rowwise().squaredNorm();
    std::mt19937_64 random(1);
    Eigen::MatrixXd centres(n, u.cols());
    Eigen::VectorXd d2 = Eigen::VectorXd::Constant(u.rows(), std::numeric_limits<double>::infinity());
    Eigen::Index chosen = u.rows() / 2;
    for (Eigen::Index j = 0; j < n; ++j) {
        centres.row(j) = u.row(chosen);
        const Eigen::VectorXd product = u * centres.row(j).transpose();
        d2 = d2.array().min(length.array() - 2 * product.array() + length[chosen]).max(0).matrix();
        double left = std::uniform_real_distribution<double>(0, d2.sum())(random);
        for (chosen = 0; chosen + 1 < u.rows() && (left -= d2[chosen]) > 0;) ++chosen;
    }
    for (int round = 0; round < 10; ++round) {
        const Eigen::MatrixXd score = (-2 * u * centres.transpose()).rowwise() + centres.rowwise().squaredNorm().transpose();
        Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(n, u.cols());
        Eigen::VectorXd counts = Eigen::VectorXd::Zero(n);
        for (Eigen::Index i = 0; i < u.rows(); ++i) {
            Eigen::Index nearest = 0;
            score.row(i).minCoeff(&nearest);
            sums.row(nearest) += u.row(i);
            counts[nearest] += 1;
        }
        for (Eigen::Index j = 0; j < n; ++j)
            if (counts[j] > 0) centres.row(j) = sums.row(j) / counts[j];
    }
    return centres;
}

void shift_quadratic(const Eigen::RowVectorXd& shift, Eigen::Ref<Eigen::VectorXd> q) {
    const Eigen::Index n = shift.size();
    q[0] -= shift.dot(q.segment(1, n));
    for (Eigen::Index k = 0, at = 1 + n; k < n; ++k)
        for (Eigen::Index j = k; j < n; ++j, ++at) {
            q[1 + k] -= q[at] * shift[j];
            q[1 + j] -= q[at] * shift[k];
            q[0] += q[at] * shift[k] * shift[j];
        }
}

}  // namespace tactiled
