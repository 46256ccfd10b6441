// Model "generic", method "rbf": centres by k-means, weights by ridge regression together with the quadratic. Spread
// and ridge are those with the smallest error on sessions or stretches of rows that are left out.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <random>

#include "decoupling/fit/corrections.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr Eigen::Index kMaxCentres = 1000;
constexpr Eigen::Index kRowsPerCentre = 20, kRowsForCentre = 5;  // in the fit, and to place a centre
constexpr double kSpreads[] = {1, 2, 4, 8};                      // in standard deviations of a channel
constexpr double kRidges[] = {1e-9, 1e-7, 1e-5, 1e-3, 1e-1};
constexpr Eigen::Index kMaxRows = 24'000;  // features of so many rows take 220 MB; more rows hardly change the fit

// k-means++ and Lloyd's iterations over a few rows per centre, always with the same random numbers. A centre that loses all
// its rows keeps its place.
Eigen::MatrixXd k_means(const Eigen::MatrixXd& all, Eigen::Index n) {
    const Eigen::Index every = std::max(Eigen::Index(1), all.rows() / (n * kRowsForCentre));
    const Eigen::MatrixXd u = all(Eigen::seq(0, Eigen::last, every), Eigen::all);
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

// Keeps every n-th row, at most kMaxRows.
void keep_some(Rows& rows, Scaled& scaled) {
    const Eigen::Index every = (scaled.u.rows() + kMaxRows - 1) / kMaxRows;
    if (every == 1) return;
    std::vector<Eigen::Index> chosen;
    Rows kept;
    for (Eigen::Index i = 0; i < scaled.u.rows(); i += every) {
        chosen.push_back(i);
        kept.push_back(rows[std::size_t(i)]);
    }
    Scaled some{.u = rows_of(scaled.u, chosen), .component = {}};
    for (const Leftover& leftover : scaled.component) {
        Leftover& here = some.component.emplace_back();
        std::vector<double> y;
        for (std::size_t i = 0; i < leftover.rows.size(); ++i) {
            if (leftover.rows[i] % every != 0) continue;
            here.rows.push_back(leftover.rows[i] / every);
            y.push_back(leftover.y[Eigen::Index(i)]);
        }
        here.y = Eigen::Map<const Eigen::VectorXd>(y.data(), Eigen::Index(y.size()));
    }
    rows = std::move(kept);
    scaled = std::move(some);
}

struct Found {
    double spread = 0, ridge = 0;
    std::vector<bool> gains;  // for each component: the error is lower than without a correction
};

// Returns the spread and the ridge with the smallest error on rows that are left out, in which components without a gain
// keep the matrix. A calibration that is fitted again to a part of its rows keeps its choice, `known` with its tables.
Found search(const Rows& rows, const Scaled& scaled, const Eigen::MatrixXd& centres, const Calibration& calibration,
             const std::map<std::string, double>& known) {
    Found found;
    const auto spread = known.find("spread"), ridge = known.find("ridge");
    if (spread != known.end() && ridge != known.end()) {
        found = {.spread = spread->second, .ridge = ridge->second, .gains = {}};
        for (std::size_t i = 0; i < scaled.component.size(); ++i)
            found.gains.push_back(!has_no_correction(calibration, "weights", i));
        return found;
    }
    double min = std::numeric_limits<double>::infinity();
    for (const double s : kSpreads) {
        const auto errors = held_out_errors(
            rows, scaled, [&](const Eigen::MatrixXd& u) { return features_of(u, centres, s); }, kRidges);
        for (std::size_t r = 0; r < std::size(kRidges); ++r) {
            double sum = 0;
            std::vector<bool> gain;
            for (const HeldOutErrors& each : errors) {
                gain.push_back(gains(each, Eigen::Index(r)));
                const Eigen::Index column = gain.back() ? Eigen::Index(r) : each.smooth.cols() - 1;
                sum += each.smooth.col(column).sum();
            }
            if (!(sum < min)) continue;
            min = sum;
            found = {.spread = s, .ridge = kRidges[r], .gains = std::move(gain)};
        }
    }
    return found;
}

void fit_rbf(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const auto known = calibration.parameters;  // the fit of the matrix clears them
    Scaled scaled = fit_matrix_and_scale(rows, calibration, warnings);
    Rows some = rows;
    keep_some(some, scaled);
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
    const auto [spread, ridge, gain] = search(some, scaled, centres, calibration, known);
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
        if (!gain[c]) {
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
        warnings.push_back(fmt::format(
            "method rbf keeps method matrix for {}: no correction lowers the error on the rows left out by more than chance",
            kept));
    calibration.tables["centres"] = rows_in(centres);
}

const FitEntry entry{.model = "generic", .method = "rbf", .fit = fit_rbf, .adds_to = "matrix", .takes_zero_drift = true};

}  // namespace
}  // namespace tactiled
