// Model "generic", method "mlp": one hidden layer of tanh under Huber's loss. The number of steps, and for each
// component the part of the network's value that is added to the matrix (0 to 1), have the smallest error on stretches
// of rows that are left out in turn. A start whose network does not help some component is followed by other starts.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <limits>
#include <string>

#include "decoupling/fit/corrections.hpp"
#include "decoupling/fit/mlp_network.hpp"
#include "decoupling/generic/methods.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr Eigen::Index kMinNeurons = 3, kMaxNeurons = 24;
constexpr std::size_t kMaxWeights = 800;
// Fewer rows for each weight of the smallest network are refused; a larger network has at least the second number.
constexpr std::size_t kRowsPerWeight = 3, kRowsPerWeightOfMore = 10;
// A step costs about rows x weights^2 multiplications: 4000 rows with 534 weights (15 channels, 6 components) take 0.1 s.
constexpr double kMaxMultiplications = 1.15e9;
constexpr Eigen::Index kMaxRows = 4000, kRowsOfAStart = 1200;
constexpr int kStarts = 4, kStepsOfAStart = 8, kSteps = 48;
// Maximum number of starts if some component gains too little, and if no component gains enough but one gains kPromising.
// One start without a gain may be chance; without a gain in any start the sensor is linear.
constexpr int kMaxTrials = 3, kMaxTrialsOfNone = 12;
constexpr double kDecay = 1e-4;     // penalty on squared weights, per row
constexpr Eigen::Index kParts = 5;  // stretches of time, as in the validation: shorter ones resemble the rest too much
constexpr double kWorth =
    0.98;  // error relative to the matrix's on the rows left out: a component that gains less keeps the matrix
constexpr double kPromising = 0.995;

// Returns every `every`-th of the rows `of`.
MlpRows some_of(const MlpRows& all, const std::vector<Eigen::Index>& of, std::size_t max) {
    const std::size_t every = std::max<std::size_t>(1, (of.size() + max - 1) / max);
    std::vector<Eigen::Index> chosen;
    for (std::size_t i = 0; i < of.size(); i += every) chosen.push_back(of[i]);
    return {rows_of(all.u, chosen), rows_of(all.y, chosen)};
}

// Principal axes of the inputs. An axis with a standard deviation above 1, along which all channels change together, is
// divided by it. Training with raw channels (skin, condition number 700) takes ten times as many steps.
struct Axes {
    Eigen::RowVectorXd mean;
    Eigen::MatrixXd turn;  // columns: axes
    explicit Axes(const Eigen::MatrixXd& u) : mean(u.colwise().mean()) {
        const Eigen::MatrixXd centred = u.rowwise() - mean;
        const dense::SymmetricEigen axes = dense::symmetric_eigen(centred.transpose() * centred / double(u.rows()));
        turn = axes.vectors * axes.values.cwiseMax(1).cwiseSqrt().cwiseInverse().asDiagonal();
    }
    [[nodiscard]] Eigen::MatrixXd of(const Eigen::MatrixXd& u) const { return (u.rowwise() - mean) * turn; }
    // Returns hidden weights for the inputs from those for the axes.
    [[nodiscard]] Eigen::MatrixXd weights_of(const Eigen::MatrixXd& hidden) const {
        Eigen::MatrixXd result(hidden.rows(), hidden.cols());
        result.rightCols(mean.size()) = hidden.rightCols(mean.size()) * turn.transpose();
        result.col(0) = hidden.col(0) - result.rightCols(mean.size()) * mean.transpose();
        return result;
    }
};

// Sums over the known values of each component: network x y, network^2, y^2.
struct Sums {
    Eigen::ArrayXd fy, ff, yy;
    // The part of the network's value with the least squared error, 0 to 1, and this error over that of the matrix.
    [[nodiscard]] Eigen::ArrayXd part() const {
        return (ff > 0).select(fy / ff.max(std::numeric_limits<double>::min()), 0.0).min(1).max(0);
    }
    [[nodiscard]] Eigen::ArrayXd error() const {
        return 1 - (2 * part() * fy - part().square() * ff) / yy.max(std::numeric_limits<double>::min());
    }
};

Sums sums_of(const MlpNetwork& network, const MlpRows& rows) {
    const Eigen::MatrixXd y = rows.y.array().isNaN().select(0, rows.y);
    const Eigen::MatrixXd f = rows.y.array().isNaN().select(0, network.values(rows.u));
    return {f.cwiseProduct(y).colwise().sum().transpose(), f.colwise().squaredNorm().transpose(),
            y.colwise().squaredNorm().transpose()};
}

// Returns the seed of the start whose cost decreases most within a few steps on some rows.
std::uint64_t best_start(const MlpRows& rows, Eigen::Index neurons, std::uint64_t seed) {
    std::uint64_t best = seed;
    double min = std::numeric_limits<double>::infinity();
    for (int start = 0; start < kStarts; ++start) {
        MlpSolver solver(rows, mlp_start(rows, neurons, kDecay, seed + std::uint64_t(start)), kDecay);
        for (int step = 0; step < kStepsOfAStart && solver.step();) ++step;
        if (start > 0 && !(solver.cost() < min)) continue;
        min = solver.cost();
        best = seed + std::uint64_t(start);
    }
    return best;
}

// Trains on `seen`; returns the sums over `unseen` before the first step and after each.
std::vector<Sums> train(const MlpRows& seen, const MlpRows& unseen, Eigen::Index neurons, std::uint64_t seed) {
    MlpSolver solver(seen, mlp_start(seen, neurons, kDecay, seed), kDecay);
    std::vector<Sums> result{sums_of(solver.network(), unseen)};
    bool moves = true;
    for (int step = 1; step <= kSteps; ++step) {
        moves = moves && solver.step();
        result.push_back(moves ? sums_of(solver.network(), unseen) : result.back());
    }
    return result;
}

struct Trained {
    MlpNetwork network;
    Eigen::ArrayXd error;  // squared error of each component on the rows left out, relative to the matrix's
};

// Trains from one start: for the number of steps, and the part of each component, that are best over all parts of the
// rows, each left out once; then on all rows.
Trained train_from(const MlpRows& all, Eigen::Index neurons, std::uint64_t seed, std::size_t max_rows) {
    std::array<std::vector<Eigen::Index>, kParts> seen, unseen;
    std::vector<Eigen::Index> every_row;
    for (Eigen::Index i = 0; i < all.u.rows(); ++i) {
        every_row.push_back(i);
        for (Eigen::Index part = 0; part < kParts; ++part)
            (i * kParts / all.u.rows() == part ? unseen : seen)[std::size_t(part)].push_back(i);
    }
    std::vector<std::future<std::vector<Sums>>> parts;
    for (std::size_t part = 0; part < kParts; ++part)
        parts.push_back(std::async(std::launch::async, [&, part] {
            return train(some_of(all, seen[part], max_rows), some_of(all, unseen[part], std::size_t(kMaxRows)), neurons,
                         seed);
        }));
    std::vector<Sums> sums = parts.front().get();
    for (std::size_t part = 1; part < kParts; ++part) {
        const std::vector<Sums> others = parts[part].get();
        for (std::size_t step = 0; step < sums.size(); ++step) {
            sums[step].fy += others[step].fy;
            sums[step].ff += others[step].ff;
            sums[step].yy += others[step].yy;
        }
    }
    const auto best = std::min_element(sums.begin(), sums.end(),
                                       [](const Sums& a, const Sums& b) { return a.error().mean() < b.error().mean(); });
    const MlpRows used = some_of(all, every_row, max_rows);
    MlpSolver solver(used, mlp_start(used, neurons, kDecay, seed), kDecay);
    for (auto step = sums.begin(); step != best && solver.step();) ++step;
    Trained trained{solver.network(), best->error()};
    // The network that was trained on all rows must lower the error on these rows, too.
    const Sums own = sums_of(trained.network, used);
    for (Eigen::Index c = 0; c < trained.error.size(); ++c) {
        const double part = best->part()[c];
        if (!(2 * part * own.fy[c] > part * part * own.ff[c])) trained.error[c] = 1;
        if (trained.error[c] < kWorth * kWorth)
            trained.network.output.row(c) *= part;
        else
            trained.network.output.row(c).setZero();
    }
    return trained;
}

// Returns the number of neurons that the rows determine. setup: throws Undetermined where it is too small
Eigen::Index neurons_for(std::size_t independent, std::size_t inputs, std::size_t components) {
    const std::size_t per_neuron = 1 + inputs + components;
    const std::size_t least = std::size_t(kMinNeurons) * per_neuron + components;
    if (independent < kRowsPerWeight * least)
        throw Undetermined(
            fmt::format("{} independent rows for the {} weights of the smallest network of method mlp; at "
                        "least {} are needed: record more loads, or use fewer channels or method matrix",
                        independent, least, kRowsPerWeight * least));
    const std::size_t weights = std::max(least, std::min(kMaxWeights, independent / kRowsPerWeightOfMore));
    return std::min(kMaxNeurons, Eigen::Index((weights - components) / per_neuron));
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
    const Axes axes(scaled.u);
    MlpRows all{axes.of(scaled.u), Eigen::MatrixXd::Constant(scaled.u.rows(), components, kNaN)};
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

    std::vector<Eigen::Index> every_row;
    for (Eigen::Index i = 0; i < all.u.rows(); ++i) every_row.push_back(i);
    const std::size_t few = std::max(std::size_t(kRowsOfAStart), std::size_t(double(kRowsPerWeight) * weights));
    const MlpRows for_starts = some_of(all, every_row, std::min(few, max_rows));
    Trained best;
    for (int trial = 0; trial < kMaxTrialsOfNone; ++trial) {
        if (trial >= kMaxTrials &&
            (best.error.minCoeff() < kWorth * kWorth || best.error.minCoeff() > kPromising * kPromising))
            break;
        const std::uint64_t first = std::uint64_t(seed) + std::uint64_t(trial) * 1'000'000'007;
        Trained other = train_from(all, neurons, best_start(for_starts, neurons, first), max_rows);
        if (trial == 0 || other.error.mean() < best.error.mean()) best = std::move(other);
        if ((best.error < kWorth * kWorth).all()) break;
    }
    const MlpNetwork& network = best.network;
    const Eigen::MatrixXd hidden = axes.weights_of(network.hidden);
    std::string kept;
    for (Eigen::Index c = 0; c < components; ++c)
        if (!(best.error[c] < kWorth * kWorth)) kept += (kept.empty() ? "" : ", ") + calibration.components[std::size_t(c)];
    if (!kept.empty())
        warnings.push_back(
            fmt::format("method mlp keeps method matrix for {}: the networks of {} trials lower the error on the rows "
                        "left out by less than {:.0f} %",
                        kept, kMaxTrials, 100 * (1 - kWorth)));

    calibration.tables["layer1"] = rows_in(hidden);
    calibration.tables["layer2"] =
        rows_in(Eigen::Map<const Eigen::VectorXd>(unit.data(), components).asDiagonal() * network.output);
    if (stated) calibration.parameters = {{"seed", seed}};
}

const FitEntry entry{
    .model = "generic", .method = "mlp", .fit = fit_mlp, .adds_to = "matrix", .must_gain = true, .takes_zero_drift = true};

}  // namespace
}  // namespace tactiled
