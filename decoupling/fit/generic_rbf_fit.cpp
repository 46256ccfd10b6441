// Model "generic", method "rbf": centres by k-means, weights by ridge regression together with the quadratic. Spread
// and ridge are those with the smallest error on a part that is left out.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <random>

#include "decoupling/fit/corrections.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr Eigen::Index kMaxCentres = 1000;
constexpr Eigen::Index kRowsPerCentre = 20;
constexpr double kSpreads[] = {1, 2, 4, 8};  // in standard deviations of a channel
constexpr double kRidges[] = {1e-9, 1e-7, 1e-5, 1e-3, 1e-1};
constexpr Eigen::Index kMaxRows = 24'000;  // features of so many rows take 220 MB; more rows hardly change the fit
constexpr int kParts = 5;                  // parts of the rows; one is left out for the search of spread and ridge
constexpr Eigen::Index kFewRows = 1000;    // with fewer rows each part is left out in turn, which takes less than a second

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

// Returns every n-th row, at most kMaxRows.
Scaled some_rows(Scaled all) {
    const Eigen::Index every = (all.u.rows() + kMaxRows - 1) / kMaxRows;
    if (every == 1) return all;
    std::vector<Eigen::Index> chosen;
    for (Eigen::Index i = 0; i < all.u.rows(); i += every) chosen.push_back(i);
    Scaled some{.u = rows_of(all.u, chosen), .component = {}};
    for (const Leftover& leftover : all.component) {
        Leftover& here = some.component.emplace_back();
        std::vector<double> y;
        for (std::size_t i = 0; i < leftover.rows.size(); ++i) {
            if (leftover.rows[i] % every != 0) continue;
            here.rows.push_back(leftover.rows[i] / every);
            y.push_back(leftover.y[Eigen::Index(i)]);
        }
        here.y = Eigen::Map<const Eigen::VectorXd>(y.data(), Eigen::Index(y.size()));
    }
    return some;
}

struct Found {
    double spread = 0, ridge = 0;
    std::vector<bool> gains;  // for each component: the error is lower than without a correction
};

// Searches for the spread and the ridge with the smallest error on stretches of rows that are left out: on every fifth
// stretch, or each of the fifths in turn if there are few rows. One Gram matrix and one right-hand side per spread, one
// factorisation per ridge.
Found search(const Scaled& scaled, const Eigen::MatrixXd& centres) {
    const Eigen::MatrixXd y = units_left(scaled);
    const Eigen::Index stretch = std::max<Eigen::Index>(1, scaled.u.rows() / (kParts * kParts));
    std::vector<int> parts{kParts / 2};
    if (scaled.u.rows() < kFewRows) parts = {0, 1, 2, 3, 4};
    std::array<std::array<Eigen::RowVectorXd, std::size(kRidges)>, std::size(kSpreads)> squares;
    for (auto& of_spread : squares) of_spread.fill(Eigen::RowVectorXd::Zero(y.cols()));
    Eigen::RowVectorXd before = Eigen::RowVectorXd::Zero(y.cols());
    for (const int part : parts) {
        std::vector<Eigen::Index> seen, unseen;
        for (Eigen::Index i = 0; i < scaled.u.rows(); ++i) (i / stretch % kParts == part ? unseen : seen).push_back(i);
        const Eigen::MatrixXd y_seen = rows_of(y, seen), y_unseen = rows_of(y, unseen);
        const Eigen::MatrixXd u_seen = rows_of(scaled.u, seen), u_unseen = rows_of(scaled.u, unseen);
        before += y_unseen.colwise().squaredNorm();
        for (std::size_t s = 0; s < std::size(kSpreads); ++s) {
            const Eigen::MatrixXd of_seen = features_of(u_seen, centres, kSpreads[s]);
            const Eigen::MatrixXd of_unseen = features_of(u_unseen, centres, kSpreads[s]);
            const Ridge ridge_of_seen(of_seen);
            const Eigen::MatrixXd feature_y = of_seen.transpose() * y_seen;
            for (std::size_t r = 0; r < std::size(kRidges); ++r)
                squares[s][r] += (y_unseen - of_unseen * ridge_of_seen.solve(feature_y, kRidges[r])).colwise().squaredNorm();
        }
    }
    Found found;
    double min = std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < std::size(kSpreads); ++s)
        for (std::size_t r = 0; r < std::size(kRidges); ++r) {
            if (!(squares[s][r].sum() < min)) continue;
            min = squares[s][r].sum();
            found = {.spread = kSpreads[s], .ridge = kRidges[r], .gains = {}};
            for (Eigen::Index c = 0; c < y.cols(); ++c) found.gains.push_back(squares[s][r][c] < before[c]);
        }
    return found;
}

void fit_rbf(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const Scaled scaled = some_rows(fit_matrix_and_scale(rows, calibration, warnings));
    const Eigen::Index n_quadratic = 1 + scaled.u.cols() + scaled.u.cols() * (scaled.u.cols() + 1) / 2;
    std::size_t independent = rows.size();
    for (const auto& name : calibration.components)
        independent = std::min(independent, independent_rows(rows, component_index(name)));
    const Eigen::Index n_centres = std::min(kMaxCentres, Eigen::Index(independent) / kRowsPerCentre);
    const auto needed = std::max(std::size_t(8 * kRowsPerCentre), kRowsPerCoefficient * std::size_t(n_quadratic));
    if (independent < needed)
        throw Undetermined(
            fmt::format("{} independent rows for method rbf; at least {} are needed: record more loads, or "
                        "use fewer channels or method matrix",
                        independent, needed));
    const Eigen::MatrixXd centres = k_means(scaled.u, n_centres);
    const auto [spread, ridge, gains] = search(scaled, centres);
    calibration.parameters = {{"spread", spread}, {"ridge", ridge}};
    auto &weights = calibration.tables["weights"], &quadratic = calibration.tables["quadratic"];
    weights.clear();
    quadratic.clear();
    const Eigen::MatrixXd features = features_of(scaled.u, centres, spread);
    const Ridge of_all(features);
    std::string kept;
    for (std::size_t c = 0; c < scaled.component.size(); ++c) {
        const Leftover& leftover = scaled.component[c];
        Eigen::VectorXd y = Eigen::VectorXd::Zero(features.rows()), w = Eigen::VectorXd::Zero(features.cols());
        std::vector<bool> has(std::size_t(features.rows()));
        for (std::size_t i = 0; i < leftover.rows.size(); ++i) {
            y[leftover.rows[i]] = leftover.y[Eigen::Index(i)];
            has[std::size_t(leftover.rows[i])] = true;
        }
        std::vector<Eigen::Index> missing;
        for (Eigen::Index i = 0; i < features.rows(); ++i)
            if (!has[std::size_t(i)]) missing.push_back(i);
        if (!gains[c]) {
            kept += (kept.empty() ? "" : ", ") + calibration.components[c];
        } else if (missing.empty()) {
            w = of_all.solve(features.transpose() * y, ridge);
        } else if (missing.size() < leftover.rows.size()) {
            Ridge own = of_all;
            own.take_out(rows_of(features, missing));
            w = own.solve(features.transpose() * y, ridge);
        } else {
            w = Ridge(rows_of(features, leftover.rows)).solve(features.transpose() * y, ridge);
        }
        quadratic.emplace_back(w.data(), w.data() + n_quadratic);
        weights.emplace_back(w.data() + n_quadratic, w.data() + w.size());
    }
    if (!kept.empty())
        warnings.push_back(
            fmt::format("method rbf keeps method matrix for {}: no correction lowers the error on the rows left out", kept));
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
