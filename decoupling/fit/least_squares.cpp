#include "decoupling/fit/least_squares.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tactiled {
namespace {

// A combination of unit columns that is shorter than this is rounding or the last digit of a file (single-precision
// recordings carry 1e-7 of each reading), not the effect of a force.
constexpr double kNothing = 1e-7;
// A column belongs to the dependence if its share in it is at least this.
constexpr double kPart = 0.1;

// Computed twice: the mean of a column of large numbers is corrected by the mean of the rest.
Eigen::RowVectorXd means(const Eigen::MatrixXd& x) {
    const Eigen::RowVectorXd first = x.colwise().mean();
    return first + (x.rowwise() - first).colwise().mean();
}

}  // namespace

LeastSquares least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& y) {
    LeastSquares result;
    const Eigen::RowVectorXd length = a.colwise().norm();
    for (Eigen::Index k = 0; k < a.cols(); ++k)
        if (!(length[k] > 0) || !std::isfinite(length[k])) result.dependent.push_back(std::size_t(k));
    if (!result.dependent.empty()) {
        result.condition = std::numeric_limits<double>::infinity();
        return result;
    }
    const Eigen::MatrixXd scaled = a.array().rowwise() / length.array();
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(scaled);
    // The singular values of the small R are those of the tall matrix.
    const Eigen::Index n = a.cols();
    Eigen::MatrixXd r = Eigen::MatrixXd::Zero(n, n);
    r.topRows(std::min(n, a.rows())) = qr.matrixR().topRows(std::min(n, a.rows())).template triangularView<Eigen::Upper>();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(r * qr.colsPermutation().transpose(), Eigen::ComputeFullV);
    const double greatest = svd.singularValues()[0], min = svd.singularValues()[n - 1];
    result.condition = min > 0 ? greatest / min : std::numeric_limits<double>::infinity();
    if (min <= kNothing * greatest) {
        for (Eigen::Index k = 0; k < n; ++k)
            if (std::abs(svd.matrixV()(k, n - 1)) > kPart) result.dependent.push_back(std::size_t(k));
        return result;
    }
    result.coefficient = qr.solve(y).array() / length.transpose().array();
    return result;
}

Affine affine_fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& y) {
    Affine result;
    result.centre = means(x);
    const double y_mean = means(y)[0];
    result.slope = least_squares(x.rowwise() - result.centre, y.array() - y_mean);
    if (result.slope.dependent.empty()) result.constant = y_mean - result.centre.dot(result.slope.coefficient);
    return result;
}

double median(std::vector<double> values) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

double quantile(std::vector<double> values, double share) {
    const auto at = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

double robust_sd(const Eigen::VectorXd& errors) {
    const Eigen::VectorXd sizes = errors.cwiseAbs();
    return kRobustSd * median({sizes.begin(), sizes.end()});
}

}  // namespace tactiled
