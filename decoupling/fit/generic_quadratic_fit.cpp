// Model "generic", method "quadratic": least squares of all products of two channels. A ridge, or no
// correction at all, is taken if its error on stretches of rows that are left out is smaller: products that repeat each
// other fit noise.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "decoupling/fit/corrections.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr Eigen::Index kParts = 5;  // stretches of time, as in the validation
// The first stands for the exact solution, the last one is followed by no correction. Features have a mean square of 1.
constexpr std::array kRidges{1e-10, 1e-8, 1e-6, 1e-4, 1e-2};
// Errors on the rows left out: of any correction relative to none, of a ridge relative to the exact solution. A smaller
// gain may be chance, and outside these rows the correction may do harm.
constexpr double kWorth = 0.95, kRidgeWorth = 0.8;
// Or the exact solution lowers the squared error on its own rows to this: noise is lowered by a third at most, because
// there are kRowsPerCoefficient rows.
constexpr double kExplains = 0.5;
constexpr Eigen::Index kChunk = 2048;  // rows whose features are in memory at a time

// Calls f(first row, features) for each chunk of the rows begin .. end.
template <class F>
void for_each_chunk(const Eigen::MatrixXd& u, Eigen::Index begin, Eigen::Index end, const F& f) {
    for (; begin < end; begin += kChunk) f(begin, quadratic_features(u.middleRows(begin, std::min(kChunk, end - begin))));
}

// Returns for each component the index of its ridge, 0: exact, kRidges.size(): no correction.
std::vector<std::size_t> search(const Scaled& scaled, Eigen::Index n_features) {
    const Eigen::MatrixXd y = units_left(scaled);
    const auto begin_of = [&](Eigen::Index part) { return part * y.rows() / kParts; };
    std::vector<Eigen::MatrixXd> gram, feature_y;
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(n_features, n_features), all_y = Eigen::MatrixXd::Zero(n_features, y.cols());
    for (Eigen::Index part = 0; part < kParts; ++part) {
        gram.emplace_back(Eigen::MatrixXd::Zero(n_features, n_features));
        feature_y.emplace_back(Eigen::MatrixXd::Zero(n_features, y.cols()));
        for_each_chunk(scaled.u, begin_of(part), begin_of(part + 1), [&](Eigen::Index at, const Eigen::MatrixXd& features) {
            gram.back().selfadjointView<Eigen::Lower>().rankUpdate(features.transpose());
            feature_y.back() += features.transpose() * y.middleRows(at, features.rows());
        });
        all += gram.back();
        all_y += feature_y.back();
    }
    Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(Eigen::Index(kRidges.size()) + 1, y.cols());
    squares.bottomRows(1) = y.colwise().squaredNorm();
    for (Eigen::Index part = 0; part < kParts; ++part) {
        const auto rows_seen = double(y.rows() - (begin_of(part + 1) - begin_of(part)));
        std::vector<Eigen::MatrixXd> weights;
        for (const double ridge : kRidges) {
            Eigen::MatrixXd regular = all - gram[std::size_t(part)];
            regular.diagonal().array() += ridge * rows_seen;
            weights.push_back(dense::solve_by_llt(regular, all_y - feature_y[std::size_t(part)]));
        }
        for_each_chunk(scaled.u, begin_of(part), begin_of(part + 1), [&](Eigen::Index at, const Eigen::MatrixXd& features) {
            for (std::size_t r = 0; r < kRidges.size(); ++r)
                squares.row(Eigen::Index(r)) +=
                    (y.middleRows(at, features.rows()) - features * weights[r]).colwise().squaredNorm();
        });
    }
    Eigen::MatrixXd regular = all;
    regular.diagonal().array() += kRidges.front() * double(y.rows());
    const Eigen::RowVectorXd explained = all_y.cwiseProduct(dense::solve_by_llt(regular, all_y)).colwise().sum();
    std::vector<std::size_t> chosen;
    for (Eigen::Index c = 0; c < y.cols(); ++c) {
        Eigen::Index best = 0;
        const double min = squares.col(c).minCoeff(&best);
        const double none = squares(squares.rows() - 1, c);
        if (!(min < kWorth * kWorth * none) && !(none - explained[c] < kExplains * none))
            chosen.push_back(kRidges.size());
        else
            chosen.push_back(min < kRidgeWorth * kRidgeWorth * squares(0, c) ? std::size_t(best) : 0);
    }
    return chosen;
}

// Returns the triangle of (features, y): its last columns are y in the basis of the features.
Eigen::MatrixXd triangle_of(const Eigen::MatrixXd& u, const Eigen::MatrixXd& y, Eigen::Index n_features) {
    Eigen::MatrixXd triangle(0, n_features + y.cols());
    for_each_chunk(u, 0, u.rows(), [&](Eigen::Index at, const Eigen::MatrixXd& features) {
        Eigen::MatrixXd stacked(triangle.rows() + features.rows(), triangle.cols());
        stacked << triangle, features, y.middleRows(at, features.rows());
        triangle = dense::triangle_of(stacked);
    });
    return triangle;
}

Eigen::MatrixXd exact_solution(const Eigen::MatrixXd& triangle, Eigen::Index n) {
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver(triangle.topLeftCorner(n, n));
    return solver.solve(triangle.topRightCorner(n, triangle.cols() - n));
}

void fit_quadratic(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const Scaled scaled = fit_matrix_and_scale(rows, calibration, warnings);
    const Eigen::Index n = 1 + scaled.u.cols() + scaled.u.cols() * (scaled.u.cols() + 1) / 2;
    for (const auto& component : calibration.components) {
        const std::size_t independent = independent_rows(rows, component_index(component));
        const auto needed = kRowsPerCoefficient * std::size_t(n);
        if (independent < needed)
            throw Undetermined(
                fmt::format("{} independent rows with {} for {} coefficients of method quadratic; at least {} "
                            "are needed: record more loads, or use fewer channels or method matrix",
                            independent, component, n, needed));
    }
    const std::vector<std::size_t> ridge = search(scaled, n);
    // Components with a label in every row share one triangle.
    const auto has_all = [&](const Leftover& leftover) { return Eigen::Index(leftover.rows.size()) == scaled.u.rows(); };
    Eigen::MatrixXd y(scaled.u.rows(), 0);
    for (std::size_t i = 0; i < scaled.component.size(); ++i)
        if (has_all(scaled.component[i]) && ridge[i] < kRidges.size()) {
            y.conservativeResize(y.rows(), y.cols() + 1);
            y.rightCols(1) = scaled.component[i].y;
        }
    const Eigen::MatrixXd shared = y.cols() > 0 ? triangle_of(scaled.u, y, n) : y;
    // Products of correlated channels are dependent: the shortest of the equally good solutions is taken.
    const bool any_exact = std::count(ridge.begin(), ridge.end(), std::size_t{0}) > 0;
    const Eigen::MatrixXd exact = y.cols() > 0 && any_exact ? exact_solution(shared, n) : y;
    Eigen::Index next = 0;  // column of the next component in `exact`
    std::string kept;
    auto& table = calibration.tables["quadratic"];
    table.clear();
    for (std::size_t i = 0; i < scaled.component.size(); ++i) {
        const Leftover& leftover = scaled.component[i];
        Eigen::VectorXd q = Eigen::VectorXd::Zero(n);
        if (ridge[i] == kRidges.size()) {
            kept += (kept.empty() ? "" : ", ") + calibration.components[i];
            table.emplace_back(q.data(), q.data() + q.size());
            continue;
        }
        const bool all = has_all(leftover);
        const Eigen::MatrixXd own = all ? Eigen::MatrixXd() : triangle_of(rows_of(scaled.u, leftover.rows), leftover.y, n);
        const Eigen::Index column = all ? next++ : 0;
        if (ridge[i] == 0) {
            q = all ? Eigen::VectorXd(exact.col(column)) : Eigen::VectorXd(exact_solution(own, n).col(0));
        } else {
            const Eigen::MatrixXd& triangle = all ? shared : own;
            const Eigen::MatrixXd r = triangle.topLeftCorner(n, n);
            Eigen::MatrixXd gram = r.transpose() * r;
            gram.diagonal().array() += kRidges[ridge[i]] * double(leftover.rows.size());
            q = dense::solve_by_llt(gram, r.transpose() * triangle.col(n + column).head(n));
        }
        table.emplace_back(q.data(), q.data() + q.size());
    }
    if (!kept.empty())
        warnings.push_back(
            fmt::format("method quadratic keeps method matrix for {}: products of channels lower the error "
                        "on the rows left out by less than {:.0f} %",
                        kept, 100 * (1 - kWorth)));
}

const FitEntry entry{
    .model = "generic", .method = "quadratic", .fit = fit_quadratic, .adds_to = "matrix", .takes_zero_drift = true};

}  // namespace
}  // namespace tactiled
