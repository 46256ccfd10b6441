// Model "table", method "nonlinear": curve and play operators together, in addition to the fit of "linear". The rows
// of one session are taken as one stretch of time that begins unloaded.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/table_fit.hpp"
#include "decoupling/solve/monotone_curve.hpp"
#include "decoupling/solve/play_hysteresis.hpp"
#include "decoupling/table/methods.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kPlayOperators = 16, kKnots = 8;
constexpr int kRounds = 5;            // for curve and play operators together
constexpr double kSomething = 0.002;  // relative to the range: the minimum effect of a curve or a loop that is kept

// One load and its estimate by the linear method, in the order of time; `starts[i]`: a session begins with row i.
struct Track {
    std::vector<double> load, reading;
    std::vector<bool> starts;
};

// Fits play operators from `input` to `reading`, with additional columns `beside`, whose coefficients become `more`.
// The constant is subtracted from the readings and added to `constant`: the zero of the straight line is in the
// middle of the loop, that of the play operators at the state that was never loaded.
PlayOperators fit_play_operators(const std::vector<double>& input, Track& track, const std::vector<double>& thresholds,
                                 const Eigen::MatrixXd& beside, Eigen::VectorXd& more, double& constant) {
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
    PlayOperators operators;
    operators.n = thresholds.size();
    std::copy(thresholds.begin(), thresholds.end(), operators.threshold.begin());
    more = Eigen::VectorXd::Zero(beside.cols());
    while (!kept.empty()) {
        const auto of_operators = Eigen::Index(kept.size());
        Eigen::MatrixXd a = Eigen::MatrixXd::Ones(n, of_operators + beside.cols() + 1);
        for (std::size_t i = 0; i < kept.size(); ++i) a.col(Eigen::Index(i)) = columns.col(Eigen::Index(kept[i]));
        a.middleCols(of_operators, beside.cols()) = beside;
        const LeastSquares solved = least_squares(a, y);
        if (!solved.dependent.empty()) {  // play operators that no row moved independently
            kept.erase(kept.begin() + std::ptrdiff_t(std::min(solved.dependent.back(), kept.size() - 1)));
            continue;
        }
        operators.weight.fill(0);
        for (std::size_t i = 0; i < kept.size(); ++i) operators.weight[kept[i]] = solved.coefficient[Eigen::Index(i)];
        if (PlayOperators::fault_of({operators.threshold.data(), operators.n}, {operators.weight.data(), operators.n})
                .empty()) {
            const double offset = solved.coefficient[of_operators + beside.cols()];
            y.array() -= offset;
            constant += offset;
            more = solved.coefficient.segment(of_operators, beside.cols());
            return operators;
        }
        if (kept.size() == 1) break;
        kept.pop_back();
    }
    operators.weight.fill(0);
    operators.weight[0] = 1;
    return operators;
}

// bend[0] load + bend[1] load^2 / max + bend[2] load^3 / max^2
double bent(double load, double max, const Eigen::Vector3d& bend) {
    const double share = load / max;
    return load * (bend[0] + share * (bend[1] + share * bend[2]));
}

void fit_table_nonlinear(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    fit_table_linear(rows, calibration, warnings);
    calibration.tables.clear();
    const Rows whole = rows_with(rows, component_indices(calibration.components));
    const auto linear = decoupler_of_fit(calibration, "nonlinear");  // still without curve and play operators
    std::array<Track, 3> track;                                      // Fx Fy N
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
        const auto [min, max] = std::minmax_element(one.load.begin(), one.load.end());
        span = std::max(span, *max - *min);
    }
    std::array<PlayOperators, 3> operators;
    std::array<double, 3> constant{};
    // A play operator of half the span of the loads never moves back; thresholds are closer together for narrow
    // spans.
    std::vector<double> thresholds;
    for (std::size_t i = 0; i < kPlayOperators; ++i)
        thresholds.push_back(span / 2 * std::pow(double(i) / double(kPlayOperators), 1.5));
    // Curve and play operators of the press together, with a smooth curve. If the loads stay above 0 after the first
    // contact, a curve with free knots interprets the effect of the history as a jump between rest and the smallest load,
    // and every first load has an error (3 % of full scale, with a stated standard deviation of 0.6 %).
    Eigen::Vector3d bend(1, 0, 0);
    Eigen::VectorXd more;
    const double max = *std::max_element(track[2].load.begin(), track[2].load.end());
    if (max > 0) {
        Eigen::MatrixXd beside(Eigen::Index(track[2].load.size()), 2);
        for (Eigen::Index i = 0; i < beside.rows(); ++i) {
            const double load = track[2].load[std::size_t(i)], share = load / max;
            beside.row(i) << load * share, load * share * share;
        }
        for (int round = 0; round < kRounds; ++round) {
            std::vector<double> input;
            for (const double load : track[2].load) input.push_back(bent(load, max, bend));
            const PlayOperators rough = fit_play_operators(input, track[2], thresholds, beside, more, constant[2]);
            // A rising load moves all play operators, so the additional columns are one more curvature of their
            // input.
            bend *= std::accumulate(rough.weight.begin(), rough.weight.begin() + kPlayOperators, 0.0);
            bend.tail<2>() += more;
        }
    }
    std::vector<std::vector<double>> curve;
    for (std::size_t i = 0; max > 0 && i <= kKnots; ++i) {
        const double load = max * double(i) / double(kKnots);
        curve.push_back({load, bent(load, max, bend)});
        if (i == 0 || curve[i][1] > curve[i - 1][1]) continue;
        curve.clear();
        break;
    }
    std::vector<double> pressed = track[2].load;
    if (curve.empty()) {
        warnings.emplace_back("the readings of a press do not rise with it, or too few loads: no normal_curve");
    } else {
        std::vector<double> x, y;
        for (const auto& point : curve) x.push_back(point[0]), y.push_back(point[1]);
        const MonotoneCurve forward(x, y);
        for (double& load : pressed) load = forward.at(load);
    }
    const Eigen::MatrixXd nothing(Eigen::Index(pressed.size()), 0);
    for (std::size_t c = 0; c < 3; ++c)
        operators[c] =
            fit_play_operators(c == 2 ? pressed : track[c].load, track[c], thresholds, nothing, more, constant[c]);
    const auto gains = gains_of_signs({calibration, kLinearParameters});
    for (std::size_t k = 0; k < gains.size(); ++k)
        for (std::size_t c = 0; c < 3; ++c) calibration.zero[k] += gains[k][c] * constant[c];
    const auto loop = [&](const PlayOperators& one) {
        double width = 0;
        for (std::size_t i = 1; i < one.n; ++i) width = std::max(width, std::abs(one.weight[i]));
        return width;
    };
    if (!curve.empty()) calibration.tables["normal_curve"] = curve;
    if (std::max({loop(operators[0]), loop(operators[1]), loop(operators[2])}) > kSomething) {
        auto& table = calibration.tables["hysteresis"];
        for (std::size_t i = 0; i < kPlayOperators; ++i)
            table.push_back({thresholds[i], operators[0].weight[i], operators[1].weight[i], operators[2].weight[i]});
    }
    (void)decoupler_of_fit(calibration, "nonlinear");
}

const FitEntry entry{.model = "table", .method = "nonlinear", .fit = fit_table_nonlinear, .channels = kGauge};

}  // namespace
}  // namespace tactiled
