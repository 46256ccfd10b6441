// Model "generic", method "rbf": centres by k-means, weights by ridge regression together with the quadratic. Spread
// and ridge are those with the smallest error on a part that is left out.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <random>

#include "decoupling/fit/corrections.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr Eigen::Index kMaxCentres = 1000;
constexpr Eigen::Index kRowsPerCentre = 20;
constexpr double kSpreads[] = {1, 2, 4, 8};  // in standard deviations of a channel
constexpr double kRidges[] = {1e-9, 1e-7, 1e-5, 1e-3};
constexpr int kParts = 5;  // one of these parts is left out for the search of spread and ridge

// k-means++ and Lloyd's iterations, always with the same random numbers. A centre that loses all its rows keeps its
// place.
Eigen::MatrixXd k_means(const Eigen::MatrixXd& u, Eigen::Index n) {
    std::mt19937_64 random(1);
    Eigen::MatrixXd centres(n, u.cols());
    Eigen::VectorXd d2 = Eigen::VectorXd::Constant(u.rows(), std::numeric_limits<double>::infinity());
    Eigen::Index chosen = u.rows() / 2;
    for (Eigen::Index j = 0; j < n; ++j) {
        centres.row(j) = u.row(chosen);
        d2 = d2.cwiseMin((u.rowwise() - centres.row(j)).rowwise().squaredNorm());
        double left = std::uniform_real_distribution<double>(0, d2.sum())(random);
        for (chosen = 0; chosen + 1 < u.rows() && (left -= d2[chosen]) > 0;) ++chosen;
    }
    const Eigen::VectorXd length = u.rowwise().squaredNorm();
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

Eigen::MatrixXd features_of(const Eigen::MatrixXd& u, const Eigen::MatrixXd& centres, double spread) {
    const Eigen::MatrixXd quadratic = quadratic_features(u);
    Eigen::MatrixXd features(u.rows(), quadratic.cols() + centres.rows());
    features.leftCols(quadratic.cols()) = quadratic;
    for (Eigen::Index j = 0; j < centres.rows(); ++j)
        features.col(quadratic.cols() + j) =
            (1 + (u.rowwise() - centres.row(j)).rowwise().squaredNorm().array() / (spread * spread)).inverse();
    return features;
}

// Returns the residual of the matrix, one column per component, in units of its root mean square. A row without a
// label counts as explained, which affects only the search.
Eigen::MatrixXd units_left(const Scaled& scaled) {
    Eigen::MatrixXd y = Eigen::MatrixXd::Zero(scaled.u.rows(), Eigen::Index(scaled.component.size()));
    for (std::size_t c = 0; c < scaled.component.size(); ++c) {
        const Leftover& leftover = scaled.component[c];
        const double unit = std::sqrt(leftover.y.squaredNorm() + std::numeric_limits<double>::min());
        for (std::size_t i = 0; i < leftover.rows.size(); ++i)
            y(leftover.rows[i], Eigen::Index(c)) = leftover.y[Eigen::Index(i)] / unit;
    }
    return y;
}

// Searches for the spread and the ridge with the smallest error on every fifth stretch of rows. One Gram matrix and
// one right-hand side per spread, one factorisation per ridge.
void search(const Scaled& scaled, const Eigen::MatrixXd& centres, double& best_spread, double& best_ridge) {
    std::vector<Eigen::Index> seen, unseen;
    const Eigen::Index stretch = std::max<Eigen::Index>(1, scaled.u.rows() / (kParts * kParts));
    for (Eigen::Index i = 0; i < scaled.u.rows(); ++i) (i / stretch % kParts == kParts / 2 ? unseen : seen).push_back(i);
    const Eigen::MatrixXd y = units_left(scaled), y_seen = rows_of(y, seen), y_unseen = rows_of(y, unseen);
    const Eigen::MatrixXd u_seen = rows_of(scaled.u, seen), u_unseen = rows_of(scaled.u, unseen);
    double min = std::numeric_limits<double>::infinity();
    for (const double spread : kSpreads) {
        const Eigen::MatrixXd of_seen = features_of(u_seen, centres, spread);
        const Eigen::MatrixXd of_unseen = features_of(u_unseen, centres, spread);
        const Ridge ridge_of_seen(of_seen);
        const Eigen::MatrixXd feature_y = of_seen.transpose() * y_seen;
        for (const double ridge : kRidges) {
            const double sum = (y_unseen - of_unseen * ridge_of_seen.solve(feature_y, ridge)).squaredNorm();
            if (!(sum < min)) continue;
            min = sum;
            best_spread = spread;
            best_ridge = ridge;
        }
    }
}

void fit_rbf(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const Scaled scaled = fit_matrix_and_scale(rows, calibration, warnings);
    const Eigen::Index n_quadratic = 1 + scaled.u.cols() + scaled.u.cols() * (scaled.u.cols() + 1) / 2;
    std::size_t independent = rows.size();
    for (const auto& name : calibration.components)
        independent = std::min(independent, independent_rows(rows, component_index(name)));
    const Eigen::Index n_centres = std::min(kMaxCentres, Eigen::Index(independent) / kRowsPerCentre);
    const auto needed = std::max(std::size_t(8 * kRowsPerCentre), kRowsPerCoefficient * std::size_t(n_quadratic));
    if (independent < needed)
        throw Undetermined(fmt::format("{} independent rows for method rbf; at least {} are needed", independent, needed));
    const Eigen::MatrixXd centres = k_means(scaled.u, n_centres);
    double spread = 0, ridge = 0;
    search(scaled, centres, spread, ridge);
    calibration.parameters = {{"spread", spread}, {"ridge", ridge}};
    auto &weights = calibration.tables["weights"], &quadratic = calibration.tables["quadratic"];
    weights.clear();
    quadratic.clear();
    const Eigen::MatrixXd features = features_of(scaled.u, centres, spread);
    // Components with a label in every row share the Gram matrix.
    std::unique_ptr<Ridge> of_all;
    for (const Leftover& leftover : scaled.component) {
        Eigen::VectorXd w;
        if (Eigen::Index(leftover.rows.size()) == features.rows()) {
            if (of_all == nullptr) of_all = std::make_unique<Ridge>(features);
            w = of_all->solve(features.transpose() * leftover.y, ridge);
        } else {
            const Eigen::MatrixXd own = rows_of(features, leftover.rows);
            w = Ridge(own).solve(own.transpose() * leftover.y, ridge);
        }
        quadratic.emplace_back(w.data(), w.data() + n_quadratic);
        weights.emplace_back(w.data() + n_quadratic, w.data() + w.size());
    }
    auto& table = calibration.tables["centres"];
    table.clear();
    for (Eigen::Index j = 0; j < centres.rows(); ++j) {
        const Eigen::RowVectorXd centre = centres.row(j);
        table.emplace_back(centre.data(), centre.data() + centre.size());
    }
}

const FitEntry entry{.model = "generic", .method = "rbf", .fit = fit_rbf, .adds_to = "matrix", .takes_zero_drift = true};

}  // namespace
}  // namespace tactiled
