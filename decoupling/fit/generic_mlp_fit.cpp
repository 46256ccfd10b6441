// Model "generic", method "mlp": one hidden layer of tanh, all weights by Ceres (Levenberg-Marquardt) under Huber's loss,
// derivatives by back-propagation. Started from the same random numbers each time.
#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "decoupling/fit/corrections.hpp"
#include "decoupling/fit/mlp_row.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr int kMaxNeurons = 24;
constexpr std::size_t kMaxRows = 4000;  // evenly chosen: a fit shall take a minute, not an hour
constexpr double kRowsPerWeight = 3;
constexpr double kDecay = 1e-5;  // of the weights, a row

void fit_mlp(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const Scaled scaled = fit_matrix_and_scale(rows, calibration, warnings);
    const int n = int(scaled.u.cols()), components = int(scaled.component.size());
    std::size_t independent = rows.size();
    for (const auto& name : calibration.components)
        independent = std::min(independent, independent_rows(rows, component_index(name)));
    const int neurons = std::min(
        kMaxNeurons, int(double(std::min(independent, kMaxRows)) * components / kRowsPerWeight / (n + 1 + components)));
    if (neurons < 3) throw Undetermined(fmt::format("{} independent rows are too few for method mlp", independent));

    // Leftovers in units of their own standard deviation, NaN where there is no label.
    Eigen::MatrixXd y = Eigen::MatrixXd::Constant(scaled.u.rows(), components, kNaN);
    std::vector<double> unit;
    for (int c = 0; c < components; ++c) {
        const Leftover& leftover = scaled.component[std::size_t(c)];
        const double sd = std::sqrt(leftover.y.squaredNorm() / double(leftover.y.size()));
        unit.push_back(sd > 0 ? sd : 1);
        for (std::size_t i = 0; i < leftover.rows.size(); ++i)
            y(leftover.rows[i], c) = leftover.y[Eigen::Index(i)] / unit.back();
    }
    std::vector<double> hidden(std::size_t(neurons * (1 + n))), output(std::size_t(components * (1 + neurons)), 0.0);
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0, 1 / std::sqrt(double(n)));
    for (double& w : hidden) w = normal(random);

    ceres::Problem problem;
    const std::size_t step = (rows.size() + kMaxRows - 1) / kMaxRows;
    std::size_t used = 0;
    for (std::size_t i = 0; i < rows.size(); i += step, ++used)
        problem.AddResidualBlock(new MlpRow(scaled.u.row(Eigen::Index(i)), y.row(Eigen::Index(i)), neurons),
                                 new ceres::HuberLoss(2), hidden.data(), output.data());
    problem.AddResidualBlock(new Decay(int(hidden.size()), kDecay * double(used)), nullptr, hidden.data());
    problem.AddResidualBlock(new Decay(int(output.size()), kDecay * double(used)), nullptr, output.data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;  // the decay bounds the condition number
    options.max_num_iterations = 60;
    options.function_tolerance = 1e-4;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable()) throw Undetermined("method mlp does not converge: " + summary.message);

    auto &layer1 = calibration.tables["layer1"], &layer2 = calibration.tables["layer2"];
    layer1.clear();
    layer2.clear();
    for (int j = 0; j < neurons; ++j) layer1.emplace_back(hidden.begin() + j * (1 + n), hidden.begin() + (j + 1) * (1 + n));
    for (int c = 0; c < components; ++c) {
        layer2.emplace_back(output.begin() + c * (1 + neurons), output.begin() + (c + 1) * (1 + neurons));
        for (double& w : layer2.back()) w *= unit[std::size_t(c)];
    }
}

const FitEntry entry{.model = "generic", .method = "mlp", .fit = fit_mlp};

}  // namespace
}  // namespace tactiled
