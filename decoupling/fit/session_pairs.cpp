#include "decoupling/fit/session_pairs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/recording_checks.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {
namespace {

// Relative to the variance of a channel. Gains that differ by 3 % between sessions act like noise of this size, so that a
// line must not depend on small differences of channels.
constexpr double kGainsDiffer = 1e-3;
constexpr double kAlone = 0.5;   // error of a session's own line, relative to the spread of the labels
constexpr double kLoaded = 0.3;  // spread of a label over that in the other session
// Minimum eigenvalue of the correlations of the labels. 25 random loads of six axes have 0.26; fewer loads than axes: 0.
constexpr double kIndependent = 0.05;
// kTurned: error of a component by the line of the other session, for any gain. kFromOthers: error by all components of that
// line, relative to kTurned's. Gains of 3 % and zeros of 5 % gave at most 0.6 on simulated sensors with errors below kAlone.
constexpr double kTurned = 0.75, kFromOthers = 0.5;
// kExchanged: error with two channels exchanged over error without, in both directions. kMatters, kChannelMatters: minimum
// errors without the exchange. Correct sessions gave at least 0.76 for labels and 0.9 for channels, if the mean error of a
// session's own line is below kDetermined. Four pressure-dependent resistors, 0.4, gave less.
constexpr double kExchanged = 0.65, kDetermined = 0.35, kMatters = 0.1, kChannelMatters = 0.05;
// Channels with a greater correlation differ by less than 14 % of their spread: gains of 3 % look like their exchange.
constexpr double kTwins = 0.99;

// Returns (xx + ridge)^-1 y, where the ridge of each channel is relative to its variance.
Eigen::MatrixXd solve(const Eigen::MatrixXd& xx, const Eigen::MatrixXd& y) {
    const Eigen::VectorXd width = xx.diagonal().cwiseSqrt().cwiseMax(1e-300);
    Eigen::MatrixXd scaled = xx.array() / (width * width.transpose()).array();
    scaled.diagonal().array() += kGainsDiffer;
    const Eigen::MatrixXd solved = dense::solve_by_llt(scaled, y.array().colwise() / width.array());
    return solved.array().colwise() / width.array();
}

// Returns the errors of a line in a session, relative to the spread of its labels.
Eigen::VectorXd errors_of(const Eigen::MatrixXd& line, const Eigen::MatrixXd& xx, const Eigen::MatrixXd& xy,
                          const Eigen::MatrixXd& yy) {
    const Eigen::MatrixXd xx_line = xx * line;
    Eigen::VectorXd errors(yy.cols());
    for (Eigen::Index c = 0; c < yy.cols(); ++c)
        errors[c] =
            std::sqrt(std::max(0.0, 1 + (line.col(c).dot(xx_line.col(c)) - 2 * line.col(c).dot(xy.col(c))) / yy(c, c)));
    return errors;
}

bool comparable(const SessionMoments& here, const SessionMoments& there, Eigen::Index c) {
    const double ratio = std::sqrt(there.yy(c, c) / here.yy(c, c));
    return here.error[c] < kAlone && there.error[c] < kAlone && ratio > kLoaded && ratio * kLoaded < 1;
}

// Returns the mean error of the line of `here` in `there` over the comparable components, with two channels exchanged.
double error_with(const SessionMoments& here, const SessionMoments& there, std::size_t j, std::size_t k) {
    Eigen::MatrixXd line = here.line;
    line.row(Eigen::Index(j)).swap(line.row(Eigen::Index(k)));
    const Eigen::VectorXd errors = errors_of(line, there.xx, there.xy, there.yy);
    double sum = 0;
    int n = 0;
    for (Eigen::Index c = 0; c < errors.size(); ++c) {
        if (!comparable(here, there, c)) continue;
        sum += errors[c];
        ++n;
    }
    return n > 0 ? sum / n : 0;
}

// Returns the mean residual of the channels of `there` in their lines through the others from `here`, relative to their
// spread, with two channels exchanged.
double residual_with(const SessionMoments& here, const SessionMoments& there, std::size_t j, std::size_t k) {
    Eigen::MatrixXd xx = there.xx;
    xx.row(Eigen::Index(j)).swap(xx.row(Eigen::Index(k)));
    xx.col(Eigen::Index(j)).swap(xx.col(Eigen::Index(k)));
    const Eigen::VectorXd variance = (here.residual * xx).cwiseProduct(here.residual).rowwise().sum();
    return std::sqrt(std::max(0.0, variance.cwiseQuotient(xx.diagonal()).mean()));
}

using ErrorWith = double (*)(const SessionMoments&, const SessionMoments&, std::size_t, std::size_t);

// Returns the exchange that lowers the error of `here` in `there` most.
std::pair<std::size_t, std::size_t> best_exchange(ErrorWith error, const SessionMoments& here, const SessionMoments& there) {
    std::pair<std::size_t, std::size_t> best{0, 0};
    double min = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < std::size_t(here.xx.cols()); ++j)
        for (std::size_t k = j + 1; k < std::size_t(here.xx.cols()); ++k)
            if (const double with = error(here, there, j, k); with < min) min = with, best = {j, k};
    return best;
}

bool are_twins(const SessionMoments& session, std::size_t j, std::size_t k) {
    const auto xx = [&](std::size_t row, std::size_t column) { return session.xx(Eigen::Index(row), Eigen::Index(column)); };
    return xx(j, k) > kTwins * std::sqrt(xx(j, j) * xx(k, k));
}

std::optional<Disagreement> exchanged(const SessionMoments& a, const SessionMoments& b) {
    if (!(a.error.mean() < kDetermined) || !(b.error.mean() < kDetermined)) return std::nullopt;
    const ErrorWith measures[] = {error_with, residual_with};
    for (const ErrorWith error : measures) {
        const double there = error(a, b, 0, 0), back = error(b, a, 0, 0);
        const double matters = error == error_with ? kMatters : kChannelMatters;
        if (!(there > matters) || !(back > matters)) continue;
        const auto [j, k] = best_exchange(error, a, b);
        if (best_exchange(error, b, a) != std::pair(j, k) || are_twins(a, j, k)) continue;
        if (!(error(a, b, j, k) < kExchanged * there) || !(error(b, a, j, k) < kExchanged * back)) continue;
        bool lower = true;  // by the other measure, too
        for (const ErrorWith other : measures)
            lower = lower && other(a, b, j, k) + other(b, a, j, k) < other(a, b, 0, 0) + other(b, a, 0, 0);
        if (lower) return Disagreement{.exchanged = true, .a = j, .b = k, .error = error_with(a, b, j, k)};
    }
    return std::nullopt;
}

// Components that the line of `here` does not predict in `there`, although its other components do.
struct Turned {
    std::vector<bool> component;
    double error = 0;  // mean of all comparable components, predicted from all
};

Turned turned(const SessionMoments& here, const SessionMoments& there) {
    const Eigen::MatrixXd pp = here.line.transpose() * there.xx * here.line, py = here.line.transpose() * there.xy;
    const Eigen::MatrixXd mixed = solve(pp, py);
    Turned result{.component = std::vector<bool>(std::size_t(pp.cols())), .error = 0};
    int n = 0;
    for (Eigen::Index c = 0; c < pp.cols(); ++c) {
        if (!comparable(here, there, c)) continue;
        const double correlation = py(c, c) / std::sqrt(std::max(1e-300, pp(c, c) * there.yy(c, c)));
        const double direct = std::sqrt(std::max(0.0, 1 - std::pow(std::max(0.0, correlation), 2)));
        const double from_all = std::sqrt(std::max(0.0, 1 - py.col(c).dot(mixed.col(c)) / there.yy(c, c)));
        result.error += from_all;
        ++n;
        result.component[std::size_t(c)] = direct > kTurned && from_all < kFromOthers * direct;
    }
    result.error /= std::max(n, 1);
    return result;
}

}  // namespace

bool loads_go_together(const Rows& rows, const std::vector<std::size_t>& components) {
    const Rows known = rows_with(rows, components);
    if (known.size() < kFewestRows) return false;
    Eigen::MatrixXd y = labels_of(known, components);
    y.rowwise() -= Eigen::RowVectorXd(y.colwise().mean());
    std::vector<Eigen::Index> loaded;
    for (Eigen::Index c = 0; c < y.cols(); ++c)
        if (y.col(c).squaredNorm() > 0) loaded.push_back(c);
    Eigen::MatrixXd correlation(Eigen::Index(loaded.size()), Eigen::Index(loaded.size()));
    for (std::size_t i = 0; i < loaded.size(); ++i)
        for (std::size_t k = 0; k < loaded.size(); ++k)
            correlation(Eigen::Index(i), Eigen::Index(k)) = y.col(loaded[i]).normalized().dot(y.col(loaded[k]).normalized());
    return loaded.size() > 1 && !(dense::symmetric_eigen(correlation).values.minCoeff() > kIndependent);
}

std::optional<SessionMoments> moments_of(const Rows& rows, const std::vector<std::size_t>& components) {
    const Rows known = rows_with(rows, components);
    if (known.size() < kFewestRows || components.empty()) return std::nullopt;
    const auto n = Eigen::Index(known.size()), channels = Eigen::Index(known.front()->channel.size());
    if (n < 3 * (channels + 1)) return std::nullopt;
    Eigen::MatrixXd x = channels_of(known), y = labels_of(known, components);
    for (int twice = 0; twice < 2; ++twice) x.rowwise() -= Eigen::RowVectorXd(x.colwise().mean());
    y.rowwise() -= Eigen::RowVectorXd(y.colwise().mean());
    SessionMoments moments{.xx = x.transpose() * x / double(n),
                           .xy = x.transpose() * y / double(n),
                           .yy = y.transpose() * y / double(n),
                           .line = {},
                           .residual = {},
                           .error = {}};
    if (!(moments.xx.diagonal().minCoeff() > 0) || !(moments.yy.diagonal().minCoeff() > 0)) return std::nullopt;
    moments.line = solve(moments.xx, moments.xy);
    // A row of the inverse, divided by its diagonal, is the channel minus its line through the others.
    moments.residual = solve(moments.xx, Eigen::MatrixXd::Identity(channels, channels));
    const Eigen::VectorXd diagonal = moments.residual.diagonal();
    moments.residual.array().colwise() /= diagonal.array();
    moments.error = errors_of(moments.line, moments.xx, moments.xy, moments.yy);
    return moments;
}

std::optional<Disagreement> disagreement(const SessionMoments& one, const SessionMoments& other) {
    const Turned there = turned(one, other), back = turned(other, one);
    std::optional<Disagreement> turn;
    for (std::size_t c = 0; c < there.component.size() && !turn; ++c)
        if (there.component[c] && back.component[c])
            turn = Disagreement{.exchanged = false, .a = c, .b = 0, .error = there.error};
    const std::optional<Disagreement> exchange = exchanged(one, other);
    return turn && exchange ? (turn->error < exchange->error ? turn : exchange) : turn ? turn : exchange;
}

}  // namespace tactiled
