// Model "generic", method "quadratic": least squares of all products of two channels.
#include <fmt/format.h>

#include "decoupling/fit/corrections.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

void fit_quadratic(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const Scaled scaled = fit_matrix_and_scale(rows, calibration, warnings);
    const Eigen::MatrixXd features = quadratic_features(scaled.u);
    calibration.tables["quadratic"].clear();
    for (std::size_t i = 0; i < scaled.component.size(); ++i) {
        const Leftover& leftover = scaled.component[i];
        const std::size_t independent = independent_rows(rows, component_index(calibration.components[i]));
        const auto needed = kRowsPerCoefficient * std::size_t(features.cols());
        if (independent < needed)
            throw Undetermined(
                fmt::format("{} independent rows with {} for {} coefficients of method quadratic; at least {} "
                            "are needed",
                            independent, calibration.components[i], features.cols(), needed));
        // Products of correlated channels are dependent: the shortest of the equally good solutions is taken.
        const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver(rows_of(features, leftover.rows));
        const Eigen::VectorXd q = solver.solve(leftover.y);
        calibration.tables["quadratic"].emplace_back(q.data(), q.data() + q.size());
    }
}

const FitEntry entry{
    .model = "generic", .method = "quadratic", .fit = fit_quadratic, .adds_to = "matrix", .takes_zero_drift = true};

}  // namespace
}  // namespace tactiled
