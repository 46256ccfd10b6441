// Model "generic", method "mlp": one hidden layer of tanh under Huber's loss, from several random starts. The
// strength of the decay, the number of steps, and the components with a correction are those with the smallest error
// on stretches of rows that are left out.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "decoupling/fit/corrections.hpp"
#include "decoupling/fit/mlp_network.hpp"
#include "decoupling/generic/methods.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr Eigen::Index kMinNeurons = 3, kMaxNeurons = 24;
constexpr std::size_t kMaxWeights = 800;
constexpr std::size_t kRowsPerWeight = 3;
// A step costs about rows x weights^2 multiplications: 4000 rows with 534 weights (15 channels, 6 components) take 0.3 s.
constexpr double kMaxMultiplications = 1.15e9;
constexpr Eigen::Index kMaxRows = 4000, kRowsOfAStart = 1200;
constexpr int kStarts = 4, kStepsOfAStart = 15, kMaxSteps = 150, kPatience = 20;
constexpr double kDecays[] = {1e-5, 1e-3};  // penalty on squared weights, per row
constexpr Eigen::Index kStretches = 25, kParts = 5;
constexpr double kWorth =
    0.98;  // error relative to the matrix's on the rows left out: a component that gains less keeps the matrix

// Returns every `every`-th of the rows `of`.
MlpRows some_of(const MlpRows& all, const std::vector<Eigen::Index>& of, std::size_t max) {
    const std::size_t every = std::max<std::size_t>(1, (of.size() + max - 1) / max);
    std::vector<Eigen::Index> chosen;
    for (std::size_t i = 0; i < of.size(); i += every) chosen.push_back(of[i]);
    return {rows_of(all.u, chosen), rows_of(all.y, chosen)};
}

// Returns the sum of squared errors over the known values, for each component; `network` nullptr: for zero.
Eigen::ArrayXd squares_of(const MlpNetwork* network, const MlpRows& rows) {
    const Eigen::MatrixXd value =
        network == nullptr ? Eigen::MatrixXd::Zero(rows.y.rows(), rows.y.cols()) : network->values(rows.u);
    const Eigen::MatrixXd error = rows.y.array().isNaN().select(0, value - rows.y);
    return error.colwise().squaredNorm().transpose();
}

// Returns the start whose cost decreases most within a few steps on some rows.
MlpNetwork best_start(const MlpRows& rows, Eigen::Index neurons, std::uint64_t seed) {
    MlpNetwork best;
    double min = std::numeric_limits<double>::infinity();
    for (int start = 0; start < kStarts; ++start) {
        MlpSolver solver(rows, mlp_start(rows, neurons, kDecays[0], seed + std::uint64_t(start)), kDecays[0]);
        for (int step = 0; step < kStepsOfAStart && solver.step();) ++step;
        if (start > 0 && !(solver.cost() < min)) continue;
        min = solver.cost();
        best = solver.network();
    }
    return best;
}

struct Trained {
    MlpNetwork network;
    double decay = 0, error = 0;  // on the rows left out, relative to the matrix; mean of squares over the components
    int steps = 0;
};

// Trains on `seen` until the error on `unseen` has not decreased for kPatience steps; returns the best state.
Trained train(const MlpRows& seen, const MlpRows& unseen, const MlpNetwork& start, double decay) {
    const Eigen::ArrayXd of_matrix = squares_of(nullptr, unseen) + std::numeric_limits<double>::min();
    const auto error_of = [&](const MlpNetwork& network) { return (squares_of(&network, unseen) / of_matrix).mean(); };
    MlpSolver solver(seen, start, decay);
    Trained best{.network = start, .decay = decay, .error = error_of(start), .steps = 0};
    for (int step = 1; step <= kMaxSteps && step - best.steps <= kPatience && solver.step(); ++step)
        if (const double error = error_of(solver.network()); error < best.error)
            best = {.network = solver.network(), .decay = decay, .error = error, .steps = step};
    return best;
}

// Returns the number of neurons that the rows determine. setup: throws Undetermined where it is too small
Eigen::Index neurons_for(std::size_t independent, std::size_t inputs, std::size_t components) {
    const std::size_t per_neuron = 1 + inputs + components;
    const std::size_t weights = std::min(kMaxWeights, independent / kRowsPerWeight);
    const std::size_t neurons = weights < components ? 0 : (weights - components) / per_neuron;
    if (Eigen::Index(neurons) < kMinNeurons) {
        const std::size_t least = std::size_t(kMinNeurons) * per_neuron + components;
        throw Undetermined(
            fmt::format("{} independent rows for the {} weights of the smallest network of method mlp; at "
                        "least {} are needed",
                        independent, least, kRowsPerWeight * least));
    }
    return std::min(kMaxNeurons, Eigen::Index(neurons));
}

constexpr std::array<Parameter, 1> kBeforehand{kSeed};

void fit_mlp(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const CalibrationData known = known_beforehand(calibration, kBeforehand);
    const bool stated = known.has("seed");
    const double seed = stated ? known["seed"] : 1;
    const Scaled scaled = fit_matrix_and_scale(rows, calibration, warnings);
    const auto components = Eigen::Index(scaled.component.size());
    std::size_t independent = rows.size();
    for (const auto& name : calibration.components)
        independent = std::min(independent, independent_rows(rows, component_index(name)));
    const Eigen::Index neurons = neurons_for(independent, calibration.channels.size(), std::size_t(components));

    // The residual of the matrix, in units of its own standard deviation; NaN where there is no label.
    MlpRows all{scaled.u, Eigen::MatrixXd::Constant(scaled.u.rows(), components, kNaN)};
    std::vector<double> unit;
    for (Eigen::Index c = 0; c < components; ++c) {
        const Leftover& leftover = scaled.component[std::size_t(c)];
        const double sd = std::sqrt(leftover.y.squaredNorm() / double(leftover.y.size()));
        unit.push_back(sd > 0 ? sd : 1);
        for (std::size_t i = 0; i < leftover.rows.size(); ++i)
            all.y(leftover.rows[i], c) = leftover.y[Eigen::Index(i)] / unit.back();
    }
    const auto weights = double(neurons * (1 + scaled.u.cols() + components) + components);
    const auto max_rows = std::size_t(
        std::clamp(kMaxMultiplications / (weights * weights), double(kRowsPerWeight) * weights, double(kMaxRows)));

    std::vector<Eigen::Index> seen_rows, unseen_rows, all_rows;
    const Eigen::Index stretch = std::max<Eigen::Index>(1, all.u.rows() / kStretches);
    for (Eigen::Index i = 0; i < all.u.rows(); ++i) {
        (i / stretch % kParts == kParts / 2 ? unseen_rows : seen_rows).push_back(i);
        all_rows.push_back(i);
    }
    const MlpRows seen = some_of(all, seen_rows, max_rows), unseen = some_of(all, unseen_rows, std::size_t(kMaxRows));
    const std::size_t few = std::max(std::size_t(kRowsOfAStart), std::size_t(double(kRowsPerWeight) * weights));
    const MlpNetwork start = best_start(some_of(all, seen_rows, std::min(few, max_rows)), neurons, std::uint64_t(seed));
    Trained best = train(seen, unseen, start, kDecays[0]);
    if (Trained other = train(seen, unseen, start, kDecays[1]); other.error < best.error) best = std::move(other);
    const Eigen::ArrayXd gain = squares_of(&best.network, unseen) / squares_of(nullptr, unseen);

    // Trains with the same number of steps on all rows, from the network that was best without the rows left out.
    const MlpRows used = some_of(all, all_rows, max_rows);
    MlpSolver solver(used, best.network, best.decay);
    for (int step = 0; step < kStepsOfAStart && solver.step();) ++step;
    MlpNetwork network = solver.network();
    std::string kept;
    for (Eigen::Index c = 0; c < components; ++c)
        if (!(gain[c] < kWorth * kWorth)) {
            network.output.row(c).setZero();
            kept += (kept.empty() ? "" : ", ") + calibration.components[std::size_t(c)];
        }
    if (!kept.empty())
        warnings.push_back(
            fmt::format("method mlp keeps method matrix for {}: the network lowers the error on the rows "
                        "left out by less than {:.0f} %",
                        kept, 100 * (1 - kWorth)));

    auto &layer1 = calibration.tables["layer1"], &layer2 = calibration.tables["layer2"];
    layer1.clear();
    layer2.clear();
    for (Eigen::Index j = 0; j < neurons; ++j) {
        const Eigen::RowVectorXd row = network.hidden.row(j);
        layer1.emplace_back(row.data(), row.data() + row.size());
    }
    for (Eigen::Index c = 0; c < components; ++c) {
        const Eigen::RowVectorXd row = network.output.row(c) * unit[std::size_t(c)];
        layer2.emplace_back(row.data(), row.data() + row.size());
    }
    if (stated) calibration.parameters = {{"seed", seed}};
}

const FitEntry entry{
    .model = "generic", .method = "mlp", .fit = fit_mlp, .adds_to = "matrix", .must_gain = true, .takes_zero_drift = true};

}  // namespace
}  // namespace tactiled
