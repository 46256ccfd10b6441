#include "decoupling/fit/corrections.hpp"

#include <cmath>
#include <limits>

#include "decoupling/fit/labels.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {

Scaled fit_matrix_and_scale(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    fit_affine(rows, calibration, warnings);
    const auto n = Eigen::Index(calibration.channels.size());
    Scaled scaled{.u = channels_of(rows), .component = {}};
    const Eigen::Map<const Eigen::RowVectorXd> zero(calibration.zero.data(), n);
    scaled.u.rowwise() -= zero;  // now r
    const Eigen::RowVectorXd mean = scaled.u.colwise().mean();
    const Eigen::RowVectorXd width = ((scaled.u.rowwise() - mean).colwise().squaredNorm() / double(rows.size())).cwiseSqrt();
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        const Eigen::Map<const Eigen::VectorXd> m(calibration.matrix[i].data(), n);
        Leftover leftover;
        std::vector<double> y;
        for (std::size_t k = 0; k < rows.size(); ++k) {
            if (!std::isfinite(rows[k]->wrench_S[c])) continue;
            leftover.rows.push_back(Eigen::Index(k));
            y.push_back(rows[k]->wrench_S[c] - scaled.u.row(Eigen::Index(k)).dot(m));
        }
        leftover.y = Eigen::Map<const Eigen::VectorXd>(y.data(), Eigen::Index(y.size()));
        scaled.component.push_back(std::move(leftover));
    }
    scaled.u.array().rowwise() /= width.array();
    calibration.tables["width"] = {std::vector<double>(width.data(), width.data() + n)};
    return scaled;
}

double unit_of(const Leftover& leftover) { return std::sqrt(leftover.y.squaredNorm() + std::numeric_limits<double>::min()); }

Eigen::MatrixXd units_left(const Scaled& scaled) {
    Eigen::MatrixXd y = Eigen::MatrixXd::Zero(scaled.u.rows(), Eigen::Index(scaled.component.size()));
    for (std::size_t c = 0; c < scaled.component.size(); ++c) {
        const Leftover& leftover = scaled.component[c];
        const double unit = unit_of(leftover);
        for (std::size_t i = 0; i < leftover.rows.size(); ++i)
            y(leftover.rows[i], Eigen::Index(c)) = leftover.y[Eigen::Index(i)] / unit;
    }
    return y;
}

Eigen::MatrixXd quadratic_features(const Eigen::MatrixXd& u) {
    const Eigen::Index n = u.cols();
    Eigen::MatrixXd features(u.rows(), 1 + n + n * (n + 1) / 2);
    features.col(0).setOnes();
    features.middleCols(1, n) = u;
    Eigen::Index at = 1 + n;
    for (Eigen::Index k = 0; k < n; ++k)
        for (Eigen::Index j = k; j < n; ++j) features.col(at++) = u.col(k).cwiseProduct(u.col(j));
    return features;
}

Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<Eigen::Index>& rows) {
    if (Eigen::Index(rows.size()) == matrix.rows()) return matrix;
    Eigen::MatrixXd result(Eigen::Index(rows.size()), matrix.cols());
    for (std::size_t i = 0; i < rows.size(); ++i) result.row(Eigen::Index(i)) = matrix.row(rows[i]);
    return result;
}

}  // namespace tactiled
