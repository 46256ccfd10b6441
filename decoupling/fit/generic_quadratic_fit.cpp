// Model "generic", method "quadratic": least squares of all products of two channels. The ridge of each component, or no
// correction at all, is that with the smallest error on sessions or stretches of rows that are left out: products of
// channels that nearly repeat each other fit noise, and differ in the next session.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "decoupling/fit/row_sums.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

// Features have a mean square of 1. With less than the first, products of combinations of channels that show only noise
// would count.
constexpr std::array kRidges{1e-10, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1};

// Returns for each component the index of its ridge, kRidges.size(): no correction. A calibration that is
// fitted again to a part of its rows keeps its ridges: a part, such as one session, does not show how sessions differ.
std::vector<std::size_t> ridges_of(const Rows& rows, const Scaled& scaled, const Calibration& calibration) {
    const std::size_t n = scaled.component.size();
    std::vector<std::size_t> chosen;
    const auto known = calibration.tables.find("ridge");
    if (known != calibration.tables.end() && known->second.size() == 1 && known->second.front().size() == n) {
        for (std::size_t i = 0; i < n; ++i) {
            const double ridge = known->second.front()[i];
            const auto at = std::size_t(std::lower_bound(kRidges.begin(), kRidges.end(), ridge) - kRidges.begin());
            chosen.push_back(has_no_correction(calibration, "quadratic", i) ? kRidges.size()
                                                                            : std::min(at, kRidges.size() - 1));
        }
        return chosen;
    }
    for (const HeldOutErrors& errors : held_out_errors(RowSums(rows, scaled, quadratic_features), kRidges))
        chosen.push_back(best_ridge(errors));
    return chosen;
}

// Returns the triangle of (features, y): its last columns are y in the basis of the features.
Eigen::MatrixXd triangle_of(const Eigen::MatrixXd& u, const Eigen::MatrixXd& y, Eigen::Index n_features) {
    Eigen::MatrixXd triangle(0, n_features + y.cols());
    for_each_chunk(u, 0, u.rows(), quadratic_features, [&](Eigen::Index at, const Eigen::MatrixXd& features) {
        Eigen::MatrixXd stacked(triangle.rows() + features.rows(), triangle.cols());
        stacked << triangle, features, y.middleRows(at, features.rows());
        triangle = dense::triangle_of(stacked);
    });
    return triangle;
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
    const std::vector<std::size_t> ridge = ridges_of(rows, scaled, calibration);
    // Components with a label in every row share one triangle.
    const auto has_all = [&](const Leftover& leftover) { return Eigen::Index(leftover.rows.size()) == scaled.u.rows(); };
    Eigen::MatrixXd y(scaled.u.rows(), 0);
    for (std::size_t i = 0; i < scaled.component.size(); ++i)
        if (has_all(scaled.component[i]) && ridge[i] < kRidges.size()) {
            y.conservativeResize(y.rows(), y.cols() + 1);
            y.rightCols(1) = scaled.component[i].y;
        }
    const Eigen::MatrixXd shared = y.cols() > 0 ? triangle_of(scaled.u, y, n) : y;
    Eigen::Index next = 0;  // column of the next component in `shared`
    std::string kept;
    auto& table = calibration.tables["quadratic"];
    table.clear();
    std::vector<double> used;
    for (const std::size_t each : ridge) used.push_back(each == kRidges.size() ? 0 : kRidges[each]);
    calibration.tables["ridge"] = {used};
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
        const Eigen::MatrixXd& triangle = all ? shared : own;
        const Eigen::MatrixXd r = triangle.topLeftCorner(n, n);
        Eigen::MatrixXd gram = r.transpose() * r;
        gram.diagonal().array() += kRidges[ridge[i]] * double(leftover.rows.size());
        q = dense::solve_by_llt(gram, r.transpose() * triangle.col(n + column).head(n));
        table.emplace_back(q.data(), q.data() + q.size());
    }
    if (!kept.empty())
        warnings.push_back(
            fmt::format("method quadratic keeps method matrix for {}: products of channels do not lower the error on the "
                        "rows left out by more than chance",
                        kept));
}

const FitEntry entry{
    .model = "generic", .method = "quadratic", .fit = fit_quadratic, .adds_to = "matrix", .takes_zero_drift = true};

}  // namespace
}  // namespace tactiled
