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

LeastSquaresOf::LeastSquaresOf(const Eigen::MatrixXd& a) : length_(a.colwise().norm()) {
    for (Eigen::Index k = 0; k < a.cols(); ++k)
        if (!(length_[k] > 0) || !std::isfinite(length_[k])) known_.dependent.push_back(std::size_t(k));
    if (!known_.dependent.empty()) {
        known_.condition = std::numeric_limits<double>::infinity();
        return;
    }
    const Eigen::MatrixXd scaled = a.array().rowwise() / length_.array();
    qr_.compute(scaled);
    // The singular values of the small R are those of the tall matrix.
    const Eigen::Index n = a.cols();
    Eigen::MatrixXd r = Eigen::MatrixXd::Zero(n, n);
    r.topRows(std::min(n, a.rows())) = qr_.matrixR().topRows(std::min(n, a.rows())).template triangularView<Eigen::Upper>();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(r * qr_.colsPermutation().transpose(), Eigen::ComputeFullV);
    const double greatest = svd.singularValues()[0], min = svd.singularValues()[n - 1];
    known_.condition = min > 0 ? greatest / min : std::numeric_limits<double>::infinity();
    if (min <= kNothing * greatest)
        for (Eigen::Index k = 0; k < n; ++k)
            if (std::abs(svd.matrixV()(k, n - 1)) > kPart) known_.dependent.push_back(std::size_t(k));
}

LeastSquares LeastSquaresOf::solve(const Eigen::VectorXd& y) const {
    LeastSquares result = known_;
    if (result.dependent.empty()) result.coefficient = qr_.solve(y).array() / length_.transpose().array();
    return result;
}

LeastSquares least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& y) { return LeastSquaresOf(a).solve(y); }

AffineOf::AffineOf(const Eigen::MatrixXd& x) : centre_(means(x)), slope_(x.rowwise() - centre_) {}

Affine AffineOf::fit(const Eigen::VectorXd& y) const {
    const double y_mean = means(y)[0];
    Affine result{.slope = slope_.solve(y.array() - y_mean), .centre = centre_, .constant = 0};
    if (result.slope.dependent.empty()) result.constant = y_mean - centre_.dot(result.slope.coefficient);
    return result;
}

Affine affine_fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& y) { return AffineOf(x).fit(y); }

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

std::vector<std::size_t> some_of(std::size_t n, std::size_t most) {
    constexpr double kGolden = 0.6180339887498949;  // its multiples are spread evenly over 0 .. 1
    std::vector<std::size_t> chosen;
    const std::size_t count = std::min(n, most);
    for (std::size_t i = 0; i < count; ++i) {
        const double within = std::fmod(double(i) * kGolden, 1.0);
        chosen.push_back(count == n ? i : std::size_t((double(i) + within) * double(n) / double(count)));
    }
    return chosen;
}

}  // namespace tactiled
