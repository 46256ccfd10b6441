#include "decoupling/fit/monitor_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/monitor_surface.hpp"

namespace tactiled {
namespace {

constexpr double kQuantile = 0.999, kTail_sd = 3.09;  // held-out rows, and normal noise
constexpr double kMargin = 1.1;                       // the quantile of few rows is nearly their maximum
constexpr std::size_t kMostGroups = 20;               // more held-out parts change the limits little
constexpr double kNearly = 1.1;
// Variance of each channel that averaged loads do not show: noise of 0.25 % of its range; 1.25 % with one session,
// which does not show how far zeros and gains move until the next.
constexpr double kFloor = 0.01, kFloorOfOneSession = 0.05;
constexpr double kPrior = 4;  // groups

// Returns variances of the channels from `groups` each, with the mean over the channels as if it came from kPrior groups
// more: two sessions may agree in a channel by chance.
Eigen::VectorXd moderated(const Eigen::VectorXd& variance, std::size_t groups) {
    const auto g = double(groups);
    return (g * variance.array() + kPrior * variance.mean()) / (g + kPrior);
}

// The rows, by the groups that are held out.
struct Seen {
    Eigen::MatrixXd channel;   // in `unit`, as all below
    Eigen::RowVectorXd unit;   // channel_unit
    Eigen::VectorXd variance;  // noise and zero of each channel
    Axes axes;                 // principal components of all rows
    double next_session = 0;   // variance of another session over that of the held-out ones, less 1
    std::size_t loads = 0;
    std::vector<std::vector<Eigen::Index>> unseen{}, others{};  // its rows, and all others, of each group
    std::vector<Axes> axes_of_others{};
};

std::size_t sessions_in(const Rows& rows) {
    std::set<std::size_t> sessions;
    for (const auto* row : rows) sessions.insert(row->session);
    return sessions.size();
}

Eigen::VectorXd variance_of(std::size_t sessions, const Eigen::RowVectorXd& unit, const SessionZeros& zeros,
                            const Calibration& calibration) {
    const auto squared = [&](const std::vector<double>& sd) {
        Eigen::VectorXd variance = Eigen::VectorXd::Zero(unit.size());
        for (std::size_t k = 0; k < sd.size(); ++k) variance[Eigen::Index(k)] = std::pow(sd[k] / unit[Eigen::Index(k)], 2);
        return variance;
    };
    const double floor = sessions == 1 ? kFloorOfOneSession : kFloor;
    Eigen::VectorXd variance = squared(calibration.zero_drift).array() + floor * floor;
    // A reading has the zero of the next session: a tare acts on the force.
    if (!zeros.sd.empty()) variance += (1 + 1 / double(sessions)) * moderated(squared(zeros.sd), sessions);
    return variance;
}

// Returns nothing where the rows are too few.
std::optional<Seen> seen_in(const Rows& rows, const std::vector<std::size_t>& group_of_row, const SessionZeros& zeros,
                            const Calibration& calibration) {
    const std::size_t n = calibration.channels.size();
    const auto is_enough = [&](std::size_t count) { return count >= kRowsPerCoefficient * (n + 1); };
    if (n < 2 || !is_enough(rows.size())) return std::nullopt;
    Seen seen{.channel = channels_of(rows), .unit = {}, .variance = {}, .axes = {}};
    seen.unit = (seen.channel.colwise().maxCoeff() - seen.channel.colwise().minCoeff()) / 4;
    seen.unit = (seen.unit.array() > 0).select(seen.unit, 1.0);
    seen.channel = seen.channel.array().rowwise() / seen.unit.array();
    const std::size_t sessions = sessions_in(rows);
    if (sessions > 1) seen.next_session = 1 / double(sessions);
    seen.variance = variance_of(sessions, seen.unit, zeros, calibration);
    seen.axes = axes_of(rows, seen.channel, seen.variance, calibration.components);
    seen.loads = loads_of(rows).back() + 1;
    for (std::size_t part = 0; part < kMostGroups; ++part) {
        Rows others;
        std::vector<Eigen::Index> in, out;
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const bool is_in = group_of_row[i] % kMostGroups == part;
            if (!is_in) others.push_back(rows[i]);
            (is_in ? in : out).push_back(Eigen::Index(i));
        }
        if (in.empty() || !is_enough(others.size())) continue;
        seen.axes_of_others.push_back(axes_of(others, seen.channel(out, Eigen::all), seen.variance, calibration.components));
        seen.unseen.push_back(std::move(in));
        seen.others.push_back(std::move(out));
    }
    if (seen.unseen.empty()) return std::nullopt;
    return seen;
}

// The distances of all held-out rows for one number of scores.
struct HeldOutDistances {
    std::vector<double> scores, residual;
    Eigen::MatrixXd whitening;  // residuals x channels
    double growth = 0;          // mean logarithm
};

HeldOutDistances held_out(const Seen& seen, Eigen::Index m, bool with_products) {
    const Eigen::Index n = seen.channel.cols(), r = n - m;
    const Eigen::MatrixXd trailing = seen.axes.direction.rightCols(r);
    HeldOutDistances result;
    std::vector<Eigen::MatrixXd> residual;
    Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(n, n);
    for (std::size_t g = 0; g < seen.unseen.size(); ++g) {
        const Eigen::MatrixXd others = seen.channel(seen.others[g], Eigen::all);
        const Surface surface = surface_of(seen.axes_of_others[g], others, m, with_products);
        const Distances one = distances(surface, seen.channel(seen.unseen[g], Eigen::all));
        result.scores.insert(result.scores.end(), one.scores.begin(), one.scores.end());
        residual.push_back(one.residual);
        squares += one.residual.transpose() * one.residual;
        result.growth += one.growth.array().log().sum();
    }
    const auto count = double(result.scores.size());
    result.growth /= count;
    if (r == 0) return result;
    // The next session differs in every channel, and not only in the r directions in which these rows do.
    const auto whitening_of = [&](const Eigen::MatrixXd& sum, double rows) {
        Eigen::MatrixXd covariance = sum / rows;
        const Eigen::VectorXd of_channel = moderated(covariance.diagonal(), seen.unseen.size());
        covariance.diagonal() += seen.next_session * double(n) / double(r) * of_channel + seen.variance;
        return Eigen::MatrixXd(inverse_factor(trailing.transpose() * covariance * trailing) * trailing.transpose());
    };
    for (const Eigen::MatrixXd& group : residual) {
        const double others = count - double(group.rows());
        const Eigen::MatrixXd whitening =
            others > 0 ? whitening_of(squares - group.transpose() * group, others) : whitening_of(squares, count);
        const Eigen::VectorXd of_group = (group * whitening.transpose()).rowwise().norm();
        result.residual.insert(result.residual.end(), of_group.begin(), of_group.end());
    }
    result.whitening = whitening_of(squares, count);
    return result;
}

// Returns the limit for distances of n numbers each of which has the variance 1.
double limit_of(std::vector<double> held_out, Eigen::Index n) {
    // 99.9 % quantile of chi-square with n degrees of freedom (Wilson and Hilferty, 1931)
    const double w = 2 / (9 * double(n)), noise = std::sqrt(double(n) * std::pow(1 - w + kTail_sd * std::sqrt(w), 3));
    const auto at = held_out.begin() + std::ptrdiff_t(std::ceil(kQuantile * double(held_out.size()))) - 1;
    std::nth_element(held_out.begin(), at, held_out.end());
    return std::max(noise, kMargin * *at);
}

// Returns the share of the rows beyond limits from the other groups alone.
double false_alarms(const Seen& seen, const HeldOutDistances& unseen, Eigen::Index m) {
    const Eigen::Index r = seen.channel.cols() - m;
    const auto without = [](std::vector<double> distances, std::size_t from, std::size_t n) {
        distances.erase(distances.begin() + std::ptrdiff_t(from), distances.begin() + std::ptrdiff_t(from + n));
        return distances;
    };
    double outside = 0;
    std::size_t from = 0;
    for (const auto& group : seen.unseen) {
        const std::size_t n = seen.unseen.size() > 1 ? group.size() : 0;
        const double limit = std::hypot(1, limit_of(without(unseen.scores, from, n), m));
        const double residual_limit = r > 0 ? limit_of(without(unseen.residual, from, n), r) : 0;
        for (std::size_t i = from; i < from + group.size(); ++i)
            outside += unseen.scores[i] > limit || (r > 0 && unseen.residual[i] > residual_limit);
        from += group.size();
    }
    return outside / double(unseen.scores.size());
}

struct Candidate {
    Monitor monitor;
    // The change of one channel that the residual shows, relative to its range: geometric mean over the channels.
    double detectable = 0;
};

// Stores the residual of the surface through all rows.
void put_residual(const Surface& surface, const HeldOutDistances& held_out, const Seen& seen, Candidate& candidate) {
    Monitor& monitor = candidate.monitor;
    const Eigen::ArrayXd per_change = held_out.whitening.colwise().norm().transpose().array().max(1e-9);
    candidate.detectable = monitor.residual_limit * std::exp(held_out.growth / 2) / 4 / std::exp(per_change.log().mean());
    const Eigen::Index m = surface.scores.cols(), products = surface.coefficients.rows() - m;
    const Eigen::MatrixXd linear = held_out.whitening * surface.coefficients.topRows(m).transpose();
    monitor.residual =
        rows_in((held_out.whitening - linear * surface.scores.transpose()) * seen.unit.cwiseInverse().asDiagonal());
    if (products == 0) return;
    const Eigen::RowVectorXd product_mean = surface.feature_mean.tail(products);
    monitor.product_mean.assign(product_mean.begin(), product_mean.end());
    monitor.coefficients = rows_in(held_out.whitening * surface.coefficients.bottomRows(products).transpose());
    monitor.product_whitening = rows_in(surface.whitening);
    for (std::size_t i = 0; i < monitor.product_whitening.size(); ++i) monitor.product_whitening[i].resize(i + 1);
}

// Returns the monitor with m scores; nothing if there are too few loads for it.
std::optional<Candidate> monitor_of(const Seen& seen, Eigen::Index m, bool with_products) {
    const Eigen::Index r = seen.channel.cols() - m;
    if (with_products && m > Eigen::Index(kMaxScores)) return std::nullopt;
    const std::size_t features = std::size_t(m) + (with_products ? products_of(std::size_t(m)) : 0);
    if (seen.loads < kRowsPerCoefficient * (1 + features)) return std::nullopt;
    const HeldOutDistances unseen = held_out(seen, m, with_products);
    Candidate candidate;
    Monitor& monitor = candidate.monitor;
    monitor.limit = std::hypot(1, limit_of(unseen.scores, m));  // 1: all components at full scale
    if (r > 0) monitor.residual_limit = limit_of(unseen.residual, r);
    if (!std::isfinite(monitor.limit) || !std::isfinite(monitor.residual_limit)) return std::nullopt;
    monitor.false_alarms = false_alarms(seen, unseen, m);
    const Surface surface = surface_of(seen.axes, seen.channel, m, with_products);
    const Eigen::RowVectorXd mean = surface.mean.cwiseProduct(seen.unit);
    monitor.mean.assign(mean.begin(), mean.end());
    monitor.scores = rows_in(surface.scores.transpose() * seen.unit.cwiseInverse().asDiagonal());
    if (r > 0) put_residual(surface, unseen, seen, candidate);
    return candidate;
}

}  // namespace

void set_monitor(const Rows& rows, const std::vector<std::size_t>& group_of_row, const SessionZeros& zeros,
                 Calibration& calibration) {
    calibration.monitor = {};
    const std::optional<Seen> seen = seen_in(rows, group_of_row, zeros, calibration);
    if (!seen) return;
    const auto n = Eigen::Index(calibration.channels.size()), components = Eigen::Index(calibration.components.size());
    const Eigen::Index most = std::min(std::max(components, Eigen::Index(kMaxScores)), n - 1);
    std::vector<Candidate> possible;
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index m = components; m <= most; ++m)
        for (const bool with_products : {false, true}) {
            std::optional<Candidate> one = monitor_of(*seen, m, with_products);
            if (!one) continue;
            least = std::min(least, one->detectable);
            possible.push_back(std::move(*one));
        }
    // The fewest scores that find nearly as small changes as any: more follow what only these rows show.
    const auto best = std::find_if(possible.begin(), possible.end(),
                                   [&](const Candidate& one) { return one.detectable <= kNearly * least; });
    if (best != possible.end())
        calibration.monitor = std::move(best->monitor);
    else if (std::optional<Candidate> without_residual = monitor_of(*seen, n, false))
        calibration.monitor = std::move(without_residual->monitor);
}

}  // namespace tactiled
