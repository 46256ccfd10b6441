// Model "table", method "map": a scale and a zero for each gauge, for the table `influence` of the calibration. The
// labels fx fy fz mx my determine the place of the point.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/table_fit.hpp"
#include "decoupling/solve/consistency.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/table/influence_map.hpp"
#include "decoupling/table/methods.hpp"

namespace tactiled {
namespace {

constexpr double kDefaultGaugeFactor = 2;  // for Ni-Cr
constexpr std::array<Parameter, 1> kBeforehand{
    {{"gauge_factor", "channel_unit per strain", kAboveZero, kLargest, kDefaultGaugeFactor}}};

constexpr std::size_t kFewestAtRest = 5;  // minimum number of rows without load that define the zero

struct Loaded {
    InfluenceMap::At at;
    Eigen::Vector3d force_N;
    const LabelledRow* row;
};

// Returns the variance of a gauge that a point, its force and the gain error do not explain, which the search treats as
// noise. It is the median of the rows: the mean would be dominated by the largest loads and hide small ones.
double unexplained_variance(const std::vector<Loaded>& loaded, const std::vector<double>& scale,
                            const std::vector<double>& zero) {
    const auto n = Eigen::Index(scale.size());
    const Eigen::Map<const Eigen::VectorXd> gain(scale.data(), n), offset(zero.data(), n);
    std::vector<double> left;
    for (const Loaded& one : loaded) {
        Eigen::MatrixXd a(n, 5);  // derivatives by Fx Fy Fz, then by x and y
        a << one.at.value.topRows(n), (one.at.dx * one.force_N).head(n), (one.at.dy * one.force_N).head(n);
        a = gain.asDiagonal() * a;
        const Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(one.row->channel.data(), n) - offset;
        const Eigen::VectorXd load = (Eigen::VectorXd(5) << one.force_N, 0, 0).finished(), off = y - a * load;
        const LeastSquares solved = least_squares(a, off);
        if (!solved.dependent.empty()) continue;
        left.push_back((off - a * solved.coefficient).squaredNorm() / double(n - 5) -
                       std::pow(kGainError, 2) * y.squaredNorm() / double(n));
    }
    return left.empty() ? 0 : std::max(0.0, median(std::move(left)));
}

void fit_table_map(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const std::vector<std::string> all{"fx", "fy", "fz", "mx", "my"};
    if (calibration.tables.count("influence") == 0)
        throw Undetermined("method \"map\" needs the table influence: take it from calibration/table_influence.toml");
    for (const auto& name : all)
        if (std::find(calibration.components.begin(), calibration.components.end(), name) == calibration.components.end())
            throw Undetermined(fmt::format("method \"map\" needs the labels of fx fy fz mx my: {} is not there", name));
    if (calibration.components.size() > all.size())
        throw Undetermined("method \"map\" does not measure mz: leave the column mz_Nm out");
    calibration.tables.erase("gauge_scale");
    calibration.parameters["gauge_factor"] = known_beforehand(calibration, kBeforehand)["gauge_factor"];
    std::string fault;
    const auto map = influence_of(calibration, fault);
    if (!map) throw Undetermined(fault);
    const std::size_t n = calibration.channels.size();
    std::vector<std::vector<double>> model(n), measured(n), resting(n);
    std::vector<Loaded> loaded;
    int beside = 0;
    double max = 0;
    const Rows whole = rows_with(rows, component_indices(all));
    for (const auto* row : whole) max = std::max(max, std::abs(row->wrench_S[2]));
    for (const auto* row : whole) {
        const auto& w = row->wrench_S;
        const Eigen::Vector3d force(w[0], w[1], w[2]);
        Influence answer = Influence::Zero();
        if (force.norm() > 0) {
            // A row whose press is too small to determine its place has no information.
            const double x = -w[4] / w[2], y = w[3] / w[2];
            if (!(std::abs(w[2]) > 0.02 * max) || !(std::hypot(x, y) <= map->radius_m())) {
                ++beside;
                continue;
            }
            InfluenceMap::At at;
            map->at(x, y, at);
            answer = at.value;
            loaded.push_back({at, force, row});
        }
        for (std::size_t k = 0; k < n; ++k) {
            if (force.norm() == 0) resting[k].push_back(row->channel[k]);
            model[k].push_back(answer.row(Eigen::Index(k)).dot(force));
            measured[k].push_back(row->channel[k]);
        }
    }
    if (beside > 0)
        warnings.push_back(
            fmt::format("{} rows without a point on the plate (mx / fz, -my / fz), or a press below 2 %: left out", beside));
    if (model.front().size() < 3 * n) throw Undetermined("too few rows with a point on the plate");
    std::vector<double> scale;
    double scatter2 = 0;  // sum of squares of the readings at rest
    calibration.zero.clear();
    for (std::size_t k = 0; k < n; ++k) {
        const auto m = Eigen::Index(model[k].size());
        const Eigen::Map<const Eigen::VectorXd> x(model[k].data(), m), y(measured[k].data(), m);
        const Affine fitted = affine_fit(x, y);
        if (!fitted.slope.dependent.empty())
            throw Undetermined(fmt::format("gauge {}: it responds in no row", calibration.channels[k]));
        scale.push_back(fitted.slope.coefficient[0]);
        if (!(scale.back() > 0))
            throw Undetermined(
                fmt::format("gauge {} responds with the wrong sign (scale {:.3g}): swapped, or fz is not negative "
                            "under a press",
                            calibration.channels[k], scale.back()));
        // The search is nonlinear: an effect of hysteresis on all loaded rows that is taken for the zero would change
        // the place of the first touch in the loop. The zero is therefore the mean reading at rest, if there are rows
        // at rest.
        const auto& still = resting[k];
        if (still.size() < kFewestAtRest) {
            calibration.zero.push_back(fitted.constant);
            continue;
        }
        calibration.zero.push_back(std::accumulate(still.begin(), still.end(), 0.0) / double(still.size()));
        for (const double reading : still)
            scatter2 += std::pow(reading - calibration.zero.back(), 2) / double(still.size() * n);
    }
    calibration.tables["gauge_scale"] = {scale};
    // The minimum is the default of the loop: readings in whole steps may have no scatter at all.
    const double min = kDefaultNoise_per_reading * map->mean().cwiseAbs().maxCoeff();
    const double left2 = n > 5 ? unexplained_variance(loaded, scale, calibration.zero) : 0;
    calibration.parameters["noise"] = std::max({std::sqrt(scatter2), std::sqrt(left2), min});
    calibration.parameters["contact"] = 1;
    calibration.condition = 0;
    calibration.matrix.clear();
}

const FitEntry entry{
    .model = "table",
    .method = "map",
    .fit = fit_table_map,
    .channels = kGauge,
    .option = {"influence", "method map of model table: the file with the plate's influence map", add_influence}};

}  // namespace

void add_influence(const std::string& path, Fit& fit) {
    Problems problems;
    Calibration source = load_calibration(path, problems);
    problems.throw_if_any();
    if (source.method != "map") source = source.with_method("map");
    if (source.tables.count("influence") == 0) throw SetupError(path + ": has no table influence");
    fit.tables["influence"] = source.tables.at("influence");
    fit.parameters["gauge_factor"] = CalibrationData(source, kBeforehand)["gauge_factor"];
}

}  // namespace tactiled
