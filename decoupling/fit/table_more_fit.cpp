#include "decoupling/fit/table_more_fit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "decoupling/domain.hpp"
#include "decoupling/generic_methods.hpp"
#include "decoupling/influence_map.hpp"
#include "decoupling/monotone_curve.hpp"
#include "decoupling/play_hysteresis.hpp"
#include "decoupling/table_methods.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kPlays = 16, kKnots = 8;
constexpr int kRounds = 4;            // of curve and hysteresis in turn
constexpr double kSomething = 0.002;  // of the range: what a curve or a loop has to explain to be kept

Rows rows_with(const Rows& rows, const std::vector<std::string>& components) {
    Rows whole;
    for (const auto* row : rows) {
        bool all = true;
        for (const auto& name : components) all = all && std::isfinite(row->wrench_S[component_index(name)]);
        if (all) whole.push_back(row);
    }
    return whole;
}

double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value * value;
    return values.empty() ? 0 : std::sqrt(sum / double(values.size()));
}

// One load and what the linear method makes of it, in the order of time; `starts[i]`: a session begins with row i.
struct Track {
    std::vector<double> load, reading;
    std::vector<bool> starts;
};

// Play operators from `input` to `reading`, whose constant is taken off and added to `constant`: the zero of the straight
// line lies in the middle of the loop, that of the plays where it was never loaded.
Plays fit_plays(const std::vector<double>& input, Track& track, const std::vector<double>& thresholds, double& constant) {
    const auto n = Eigen::Index(input.size());
    std::vector<std::size_t> kept;
    for (std::size_t i = 0; i < thresholds.size(); ++i) kept.push_back(i);
    Eigen::MatrixXd columns(n, Eigen::Index(thresholds.size()));
    for (std::size_t i = 0; i < thresholds.size(); ++i) {
        double state = 0;
        for (Eigen::Index row = 0; row < n; ++row) {
            const double value = input[std::size_t(row)];
            if (track.starts[std::size_t(row)]) state = 0;
            state = std::max(value - thresholds[i], std::min(value + thresholds[i], state));
            columns(row, Eigen::Index(i)) = state;
        }
    }
    Eigen::Map<Eigen::VectorXd> y(track.reading.data(), n);
    Plays plays;
    plays.n = thresholds.size();
    std::copy(thresholds.begin(), thresholds.end(), plays.threshold.begin());
    while (!kept.empty()) {
        Eigen::MatrixXd a = Eigen::MatrixXd::Ones(n, Eigen::Index(kept.size()) + 1);
        for (std::size_t i = 0; i < kept.size(); ++i) a.col(Eigen::Index(i)) = columns.col(Eigen::Index(kept[i]));
        const LeastSquares solved = least_squares(a, y);
        if (!solved.dependent.empty()) {  // plays that no row moved alone
            kept.erase(kept.begin() + std::ptrdiff_t(std::min(solved.dependent.back(), kept.size() - 1)));
            continue;
        }
        plays.weight.fill(0);
        for (std::size_t i = 0; i < kept.size(); ++i) plays.weight[kept[i]] = solved.coefficient[Eigen::Index(i)];
        if (Plays::fault_of({plays.threshold.data(), plays.n}, {plays.weight.data(), plays.n}).empty()) {
            const double offset = solved.coefficient[Eigen::Index(kept.size())];
            y.array() -= offset;
            constant += offset;
            return plays;
        }
        if (kept.size() == 1) break;
        kept.pop_back();
    }
    plays.weight.fill(0);
    plays.weight[0] = 1;
    return plays;
}

std::vector<double> through(const Plays& plays, const std::vector<double>& values, const std::vector<bool>& starts) {
    PlayState state;
    std::vector<double> result;
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (starts[i]) state.forget();
        result.push_back(state.next(plays, values[i]));
    }
    return result;
}

// A rising curve from load to reading with its knots spread over the loads: the first is (0, constant). Nothing where it
// does not rise. Broken lines are fitted (hat functions, least squares): the chords of eight knots miss a parabola by
// 1 / 512 of its bend over the whole range.
std::optional<std::vector<std::vector<double>>> fit_curve(const std::vector<double>& load,
                                                          const std::vector<double>& reading) {
    const double most = *std::max_element(load.begin(), load.end());
    if (!(most > 0)) return std::nullopt;
    const auto pieces = Eigen::Index(kKnots);
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(Eigen::Index(load.size()), pieces + 1);
    for (Eigen::Index i = 0; i < a.rows(); ++i) {
        const double x = load[std::size_t(i)] / most * double(pieces);  // below 0, a pull, goes on straight
        const Eigen::Index low = x <= 0 ? 0 : std::min(Eigen::Index(x), pieces - 1);
        a(i, low) = 1 - (x - double(low));
        a(i, low + 1) = x - double(low);
    }
    const LeastSquares solved =
        least_squares(a, Eigen::Map<const Eigen::VectorXd>(reading.data(), Eigen::Index(reading.size())));
    if (!solved.dependent.empty()) return std::nullopt;
    std::vector<std::vector<double>> points;
    for (Eigen::Index j = 0; j <= pieces; ++j) {
        points.push_back({most * double(j) / double(pieces), solved.coefficient[j]});
        if (j > 0 && !(points[std::size_t(j)][1] > points[std::size_t(j) - 1][1])) return std::nullopt;
    }
    return points;
}

}  // namespace

void fit_table_matrix(const Rows& rows, Calibration& calibration, std::vector<std::string>&) {
    for (const auto& name : calibration.components)
        if (name == "mz")
            throw Undetermined("mz cannot be seen by the gauges of a table sensor: leave the column mz_Nm out");
    const Rows whole = rows_with(rows, calibration.components);
    const auto n = Eigen::Index(whole.size()), loads = Eigen::Index(calibration.components.size());
    if (n < 3 * (loads + 1)) throw Undetermined(fmt::format("{} rows have all labels; {} are needed", n, 3 * (loads + 1)));
    Eigen::MatrixXd x(n, loads);
    for (Eigen::Index i = 0; i < n; ++i)
        for (Eigen::Index j = 0; j < loads; ++j)
            x(i, j) = whole[std::size_t(i)]->wrench_S[component_index(calibration.components[std::size_t(j)])];
    auto& forward = calibration.tables["forward"];
    auto& noise = calibration.tables["noise"];
    forward.clear();
    noise.assign(1, {});
    calibration.zero.clear();
    calibration.parameters.clear();
    calibration.matrix.clear();
    calibration.condition = 0;
    double greatest = 0;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        Eigen::VectorXd y(n);
        for (Eigen::Index i = 0; i < n; ++i) y[i] = whole[std::size_t(i)]->channel[k];
        const Affine fitted = affine_fit(x, y);
        if (!fitted.slope.dependent.empty()) {
            std::vector<std::string> names;
            for (const std::size_t j : fitted.slope.dependent) names.push_back(calibration.components[j]);
            throw Undetermined(
                fmt::format("the labels of {} follow from each other: load the axes independently, or leave one "
                            "out (a point that never moves ties the moments to the forces)",
                            fmt::join(names, " ")));
        }
        calibration.zero.push_back(fitted.constant);
        forward.emplace_back(fitted.slope.coefficient.data(), fitted.slope.coefficient.data() + loads);
        const Eigen::VectorXd rest = (x * fitted.slope.coefficient).array() + fitted.constant - y.array();
        noise.front().push_back(std::sqrt(rest.squaredNorm() / double(n - loads - 1)));
        greatest = std::max(greatest, noise.front().back());
        calibration.condition = std::max(calibration.condition, fitted.slope.condition);
    }
    // A gauge is never trusted a hundred times more than the worst one: few rows may leave nothing over by chance.
    for (double& sd : noise.front()) sd = std::max({sd, greatest / 100, 1e-300});
    std::string fault;
    if (make_table_matrix(calibration, fault) == nullptr) throw Undetermined(fault);
}

void fit_table_nonlinear(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    fit_table(rows, calibration, warnings);
    calibration.tables.clear();
    const Rows whole = rows_with(rows, calibration.components);
    std::string fault;
    const auto linear = make_table_nonlinear(calibration, fault);
    if (linear == nullptr) throw Undetermined(fault);
    std::array<Track, 3> track;  // Fx Fy N
    for (std::size_t i = 0; i < whole.size(); ++i) {
        const Estimate estimate = linear->decouple({.channel = whole[i]->channel});
        for (std::size_t c = 0; c < 3; ++c) {
            track[c].load.push_back(c == 2 ? -whole[i]->wrench_S[c] : whole[i]->wrench_S[c]);
            track[c].reading.push_back(c == 2 ? -estimate.wrench_S[c] : estimate.wrench_S[c]);
            track[c].starts.push_back(i == 0 || whole[i]->session != whole[i - 1]->session);
        }
    }
    double span = 0;
    for (const auto& one : track) {
        const auto [least, most] = std::minmax_element(one.load.begin(), one.load.end());
        span = std::max(span, *most - *least);
    }
    std::vector<std::vector<double>> curve;
    std::array<Plays, 3> plays;
    std::array<double, 3> constant{};
    // A play of half the span of the loads never moves back; closer together where they are narrow.
    std::vector<double> thresholds;
    for (std::size_t i = 0; i < kPlays; ++i) thresholds.push_back(span / 2 * std::pow(double(i) / double(kPlays), 1.5));
    for (auto& one : plays) {
        one.n = kPlays;
        std::copy(thresholds.begin(), thresholds.end(), one.threshold.begin());
        one.weight[0] = 1;
    }
    // The curve first: plays can imitate one half of it.
    for (int round = 0; round <= kRounds; ++round) {
        const auto points = fit_curve(track[2].load, through(plays[2].inverse(), track[2].reading, track[2].starts));
        if (!points) {
            warnings.emplace_back("the readings of a press do not rise with it, or too few loads: no normal_curve");
            curve.clear();
            plays[2] = fit_plays(track[2].load, track[2], thresholds, constant[2]);
            break;
        }
        curve = *points;
        std::vector<double> x, y;
        const double offset = curve.front()[1];
        for (auto& reading : track[2].reading) reading -= offset;
        constant[2] += offset;
        for (auto& point : curve) {
            point[1] -= offset;
            x.push_back(point[0]);
            y.push_back(point[1]);
        }
        if (round == kRounds) break;
        const MonotoneCurve forward(x, y);
        std::vector<double> bent;
        for (const double load : track[2].load) bent.push_back(forward.at(load));
        plays[2] = fit_plays(bent, track[2], thresholds, constant[2]);
    }
    for (std::size_t c = 0; c < 2; ++c) plays[c] = fit_plays(track[c].load, track[c], thresholds, constant[c]);
    const auto gains = gains_of_signs(calibration);
    for (std::size_t k = 0; k < gains.size(); ++k)
        for (std::size_t c = 0; c < 3; ++c) calibration.zero[k] += gains[k][c] * constant[c];
    const auto loop = [&](const Plays& one) {
        double width = 0;
        for (std::size_t i = 1; i < one.n; ++i) width = std::max(width, std::abs(one.weight[i]));
        return width;
    };
    if (!curve.empty()) calibration.tables["normal_curve"] = curve;
    if (std::max({loop(plays[0]), loop(plays[1]), loop(plays[2])}) > kSomething) {
        auto& table = calibration.tables["hysteresis"];
        for (std::size_t i = 0; i < kPlays; ++i)
            table.push_back({thresholds[i], plays[0].weight[i], plays[1].weight[i], plays[2].weight[i]});
    }
    if (make_table_nonlinear(calibration, fault) == nullptr) throw Undetermined(fault);
}

void fit_table_map(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const std::vector<std::string> all{"fx", "fy", "fz", "mx", "my"};
    if (calibration.tables.count("influence") == 0)
        throw Undetermined("method \"map\" needs the table influence: take it from calibration/table_influence.toml");
    for (const auto& name : all)
        if (std::find(calibration.components.begin(), calibration.components.end(), name) == calibration.components.end())
            throw Undetermined(fmt::format("method \"map\" needs the labels of fx fy fz mx my: {} is not there", name));
    if (calibration.components.size() > all.size())
        throw Undetermined("method \"map\" cannot see mz: leave the column mz_Nm out");
    calibration.tables.erase("gauge_scale");
    calibration.parameters.emplace("gauge_factor", 2.0);
    std::string fault;
    const auto map = influence_of(calibration, fault);
    if (!map) throw Undetermined(fault);
    const std::size_t n = calibration.channels.size();
    std::vector<std::vector<double>> model(n), measured(n);
    int beside = 0;
    double most = 0;
    for (const auto* row : rows_with(rows, all)) most = std::max(most, std::abs(row->wrench_S[2]));
    for (const auto* row : rows_with(rows, all)) {
        const auto& w = row->wrench_S;
        const Eigen::Vector3d force(w[0], w[1], w[2]);
        Influence answer = Influence::Zero();
        if (force.norm() > 0) {
            // Where the press is too small to say where it was, the row says nothing.
            const double x = -w[4] / w[2], y = w[3] / w[2];
            if (!(std::abs(w[2]) > 0.02 * most) || !(std::hypot(x, y) <= map->radius_m())) {
                ++beside;
                continue;
            }
            InfluenceMap::At at;
            map->at(x, y, at);
            answer = at.value;
        }
        for (std::size_t k = 0; k < n; ++k) {
            model[k].push_back(answer.row(Eigen::Index(k)).dot(force));
            measured[k].push_back(row->channel[k]);
        }
    }
    if (beside > 0)
        warnings.push_back(
            fmt::format("{} rows without a point on the plate (mx / fz, -my / fz), or a press below 2 %: left out", beside));
    if (model.front().size() < 3 * n) throw Undetermined("too few rows with a point on the plate");
    std::vector<double> scale, rest;
    calibration.zero.clear();
    for (std::size_t k = 0; k < n; ++k) {
        const auto m = Eigen::Index(model[k].size());
        const Eigen::Map<const Eigen::VectorXd> x(model[k].data(), m), y(measured[k].data(), m);
        const Affine fitted = affine_fit(x, y);
        if (!fitted.slope.dependent.empty())
            throw Undetermined(fmt::format("gauge {}: no row makes it answer", calibration.channels[k]));
        scale.push_back(fitted.slope.coefficient[0]);
        if (!(scale.back() > 0))
            throw Undetermined(
                fmt::format("gauge {} answers with the wrong sign (scale {:.3g}): swapped, or fz is not negative "
                            "under a press",
                            calibration.channels[k], scale.back()));
        calibration.zero.push_back(fitted.constant);
        for (Eigen::Index i = 0; i < m; ++i) rest.push_back(y[i] - fitted.constant - scale.back() * x[i]);
    }
    calibration.tables["gauge_scale"] = {scale};
    calibration.parameters["noise"] = std::max(rms(rest), 1e-300);
    calibration.parameters["contact"] = 1;
    calibration.condition = 0;
    calibration.matrix.clear();
}

void add_influence(const std::string& path, Calibration& calibration) {
    Problems problems;
    Calibration source = load_calibration(path, problems);
    problems.throw_if_any();
    if (source.method != "map") source = source.with_method("map");
    if (source.tables.count("influence") == 0) throw SetupError(path + ": has no table influence");
    calibration.tables["influence"] = source.tables.at("influence");
    calibration.parameters["gauge_factor"] = parameter_or(source, "gauge_factor", 2.0);
}

}  // namespace tactiled
