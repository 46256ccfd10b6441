#include "decoupling/fit/monitor_surface.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "decoupling/fit/labels.hpp"

namespace tactiled {
namespace {

// A direction that the rows hardly show, such as the product of loads that never occurred together, has a large distance, so
// that the limit is wide there.
constexpr double kRidge = 1e-3, kLeastVariance = 1e-6;

// Returns the change of each channel with each labelled component, times the component's full scale, one row per
// component. Least squares over the rows with all labels.
Eigen::MatrixXd responses(const Rows& rows, const Eigen::MatrixXd& channel, const std::vector<std::string>& components) {
    const std::vector<std::size_t> component = component_indices(components);
    std::vector<Eigen::Index> whole;
    for (std::size_t i = 0; i < rows.size(); ++i)
        if (std::all_of(component.begin(), component.end(),
                        [&](std::size_t c) { return std::isfinite(rows[i]->wrench_S[c]); }))
            whole.push_back(Eigen::Index(i));
    const auto m = Eigen::Index(component.size());
    if (Eigen::Index(whole.size()) < 3 * (m + 1)) return Eigen::MatrixXd(0, channel.cols());
    Eigen::MatrixXd load(Eigen::Index(whole.size()), m), at = Eigen::MatrixXd(load.rows(), channel.cols());
    for (Eigen::Index i = 0; i < load.rows(); ++i) {
        at.row(i) = channel.row(whole[std::size_t(i)]);
        for (Eigen::Index c = 0; c < m; ++c)
            load(i, c) = rows[std::size_t(whole[std::size_t(i)])]->wrench_S[component[std::size_t(c)]];
    }
    const Eigen::RowVectorXd full_scale = load.cwiseAbs().colwise().maxCoeff().cwiseMax(1e-300);
    load = (load.array().rowwise() / full_scale.array()).matrix();
    load.rowwise() -= load.colwise().mean().eval();
    at.rowwise() -= at.colwise().mean().eval();
    // Components that always occurred together share their response.
    const Eigen::MatrixXd squares = load.transpose() * load;
    const double ridge = 1e-6 * std::max(squares.diagonal().maxCoeff(), 1e-300);
    return dense::solve_by_ldlt(squares + ridge * Eigen::MatrixXd::Identity(m, m), load.transpose() * at);
}

Eigen::MatrixXd features_of(const Eigen::MatrixXd& t, bool with_products) {
    const Eigen::Index m = t.cols(), products = with_products ? Eigen::Index(products_of(std::size_t(m))) : 0;
    Eigen::MatrixXd features(t.rows(), m + products);
    features.leftCols(m) = t;
    for (Eigen::Index i = 0, at = m; with_products && i < m; ++i)
        for (Eigen::Index j = i; j < m; ++j) features.col(at++) = t.col(i).cwiseProduct(t.col(j));
    return features;
}

}  // namespace

Eigen::MatrixXd inverse_factor(const Eigen::MatrixXd& covariance) {
    if (covariance.rows() == 0) return covariance;
    return dense::solve_lower(dense::lower_factor(covariance),
                              Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
}

Axes axes_of(const Rows& rows, const Eigen::MatrixXd& channel, const Eigen::VectorXd& variance,
             const std::vector<std::string>& components) {
    Axes axes{.mean = channel.colwise().mean(), .direction = {}, .sd = {}};
    std::map<std::size_t, std::vector<Eigen::Index>> of_session;
    for (std::size_t i = 0; i < rows.size(); ++i) of_session[rows[i]->session].push_back(Eigen::Index(i));
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(channel.cols(), channel.cols());
    for (const auto& [session, at] : of_session) {
        Eigen::MatrixXd z = channel(at, Eigen::all);
        z.rowwise() -= z.colwise().mean().eval();
        covariance += z.transpose() * z / double(channel.rows());
    }
    const Eigen::MatrixXd response = responses(rows, channel, components);
    covariance += double(std::max<Eigen::Index>(1, response.rows())) * response.transpose() * response;
    covariance.diagonal() += variance;
    const auto [values, vectors] = dense::symmetric_eigen(covariance);  // ascending
    axes.direction = vectors.rowwise().reverse();
    axes.sd = values.reverse().cwiseMax(1e-300).cwiseSqrt();
    return axes;
}

Surface surface_of(const Axes& axes, const Eigen::MatrixXd& channel, Eigen::Index m, bool with_products) {
    Surface surface{.mean = axes.mean,
                    .feature_mean = {},
                    .scores = {},
                    .coefficients = {},
                    .whitening = {},
                    .has_products = with_products};
    surface.scores = axes.direction.leftCols(m) * axes.sd.head(m).cwiseInverse().asDiagonal();
    const Eigen::MatrixXd z = channel.rowwise() - surface.mean;
    Eigen::MatrixXd features = features_of(z * surface.scores, with_products);
    surface.feature_mean = features.colwise().mean();
    features.rowwise() -= surface.feature_mean;
    Eigen::MatrixXd squares = features.transpose() * features / double(z.rows());
    squares.diagonal() = squares.diagonal() * (1 + kRidge) + Eigen::VectorXd::Constant(squares.rows(), kLeastVariance);
    surface.coefficients = dense::solve_by_ldlt(squares, features.transpose() * z / double(z.rows()));
    const Eigen::Index products = squares.rows() - m;
    surface.whitening = inverse_factor(squares.bottomRightCorner(products, products));
    return surface;
}

Distances distances(const Surface& surface, const Eigen::MatrixXd& channel) {
    const Eigen::MatrixXd z = channel.rowwise() - surface.mean, t = z * surface.scores;
    const Eigen::MatrixXd p = features_of(t, surface.has_products).rowwise() - surface.feature_mean;
    const Eigen::Index products = p.cols() - t.cols();
    Eigen::VectorXd of_features = t.rowwise().squaredNorm();
    if (products > 0) of_features += (p.rightCols(products) * surface.whitening.transpose()).rowwise().squaredNorm();
    const Eigen::VectorXd growth = 1 + of_features.array() / double(p.cols());
    return {.scores = t.rowwise().norm(),
            .residual = (z - p * surface.coefficients).array().colwise() / growth.array().sqrt(),
            .growth = growth};
}

}  // namespace tactiled
