// Method "nonlinear" of model "table": curve and plays in turn, on top of the fit of "linear".
#include <algorithm>
#include <cmath>
#include <optional>

#include "decoupling/fit/table_more_fit.hpp"
#include "decoupling/monotone_curve.hpp"
#include "decoupling/play_hysteresis.hpp"
#include "decoupling/table_methods.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kPlays = 16, kKnots = 8;
constexpr int kRounds = 4;            // of curve and hysteresis in turn
constexpr double kSomething = 0.002;  // of the range: what a curve or a loop has to explain to be kept

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

}  // namespace tactiled
