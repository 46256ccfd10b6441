#include "decoupling/fit/domain_fit.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "decoupling/curved_distance.hpp"
#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/labels.hpp"
#include "decoupling/joint_domain.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

// 1.4: sessions outside the calibration were up to 1.25 times beyond the held-out quantile (simulated optical skins).
constexpr double kQuantile = 0.999, kMargin = 1.4;
// Noise and drift of each channel, as a standard deviation in units of a quarter of its range: 0.25 % of the range, as in
// the joint domain. One session does not show how far zeros and gains move until the next: 1.25 %.
constexpr double kFloor = 0.01, kFloorOfOneSession = 0.05;
// Added to the covariance, times its diagonal; divided by the number S of sessions. S held-out sessions show S directions of
// the differences between sessions, and the next session differs in others. With 6 / S, zeros and gains that differ by 2 %
// from session to session lost no GOOD sample of simulated skins, and with 2 / S up to 12 %.
constexpr double kShrinkage = 6, kShrinkageOfOneSession = 2;
constexpr double kMaxFalseAlarms = 0.005;
constexpr double kHarm = 0.1;                 // minimum change of a component that counts as damage, relative to full scale
constexpr double kLeastHarmful = 0.002;       // share of damaged rows that the joint domain alone may leave undetected
constexpr double kWorth = 0.7;                // undetected damage relative to that of the joint domain alone
constexpr std::size_t kEnoughDirections = 4;  // the computing time grows with the products of the directions
constexpr std::size_t kDamagedRows = 500;
// A direction that the rows hardly show, such as the product of loads that never occurred together, has a large distance, so
// that the limit is wide there.
constexpr double kRidge = 1e-3, kLeastVariance = 1e-6;

Eigen::MatrixXd inverse_factor(const Eigen::MatrixXd& covariance) {
    return dense::solve_lower(dense::lower_factor(covariance),
                              Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
}

// The surface through some rows. Channels are minus their mean, in units of a quarter of their range.
struct Surface {
    Eigen::RowVectorXd mean, feature_mean;
    Eigen::MatrixXd directions;         // channels x directions
    Eigen::MatrixXd coefficients;       // features x channels
    Eigen::MatrixXd feature_whitening;  // lower triangle
};

Eigen::MatrixXd features_of(const Eigen::MatrixXd& y) {
    const Eigen::Index m = y.cols();
    Eigen::MatrixXd features(y.rows(), Eigen::Index(curved_features(std::size_t(m))));
    features.leftCols(m) = y;
    Eigen::Index at = m;
    for (Eigen::Index i = 0; i < m; ++i)
        for (Eigen::Index j = i; j < m; ++j) features.col(at++) = y.col(i).cwiseProduct(y.col(j));
    return features;
}

Surface surface_of(const Eigen::MatrixXd& channel, Eigen::Index m) {
    Surface surface;
    surface.mean = channel.colwise().mean();
    const Eigen::MatrixXd z = channel.rowwise() - surface.mean;
    // The singular vectors of a covariance are its eigenvectors.
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(z.transpose() * z / double(z.rows()), Eigen::ComputeThinU);
    const Eigen::VectorXd sd = svd.singularValues().head(m).cwiseSqrt().cwiseMax(1e-9);
    surface.directions = svd.matrixU().leftCols(m) * sd.cwiseInverse().asDiagonal();
    Eigen::MatrixXd features = features_of(z * surface.directions);
    surface.feature_mean = features.colwise().mean();
    features.rowwise() -= surface.feature_mean;
    Eigen::MatrixXd squares = features.transpose() * features / double(z.rows());
    squares.diagonal() = squares.diagonal() * (1 + kRidge) + Eigen::VectorXd::Constant(squares.rows(), kLeastVariance);
    surface.coefficients = dense::solve_by_ldlt(squares, features.transpose() * z / double(z.rows()));
    surface.feature_whitening = inverse_factor(squares);
    return surface;
}

// Residuals of rows, each divided by the root of its variance's growth.
Eigen::MatrixXd residuals(const Surface& surface, const Eigen::MatrixXd& channel) {
    const Eigen::MatrixXd z = channel.rowwise() - surface.mean;
    const Eigen::MatrixXd p = features_of(z * surface.directions).rowwise() - surface.feature_mean;
    const Eigen::VectorXd from_rows = (p * surface.feature_whitening.transpose()).rowwise().squaredNorm();
    const Eigen::VectorXd grown = (1 + from_rows.array() / double(p.cols())).sqrt();
    return (z - p * surface.coefficients).array().colwise() / grown.array();
}

std::vector<std::vector<double>> triangle_in(const Eigen::MatrixXd& matrix) {
    auto rows = rows_in(matrix);
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i].resize(i + 1);
    return rows;
}

struct Seen {
    Eigen::MatrixXd channel;                        // in `unit`
    Eigen::RowVectorXd unit;                        // a quarter of each channel's range, channel_unit
    Eigen::VectorXd variance;                       // noise and zero, in `unit`
    std::vector<std::vector<Eigen::Index>> groups;  // row indices
    std::size_t loads;
    double shrinkage;  // shrinkage of the covariance towards its diagonal
};

// Returns the domain with m directions, without a limit if it is not possible.
CurvedDomain domain_of(const Seen& seen, Eigen::Index m) {
    const auto is_enough = [&](std::size_t count) {
        return count >= kRowsPerCoefficient * (1 + curved_features(std::size_t(m)));
    };
    if (!is_enough(seen.loads)) return {};
    const Eigen::Index n = seen.channel.cols();
    std::vector<Eigen::MatrixXd> residual;  // residuals of each held-out group
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(n, n);
    double rows = 0;
    for (const auto& group : seen.groups) {
        std::vector<Eigen::Index> others;
        for (const auto& other : seen.groups)
            if (&other != &group) others.insert(others.end(), other.begin(), other.end());
        if (!is_enough(others.size())) continue;
        residual.push_back(residuals(surface_of(seen.channel(others, Eigen::all), m), seen.channel(group, Eigen::all)));
        all += residual.back().transpose() * residual.back();
        rows += double(group.size());
    }
    if (residual.empty()) return {};
    const auto whitening_of = [&](const Eigen::MatrixXd& squares, double count) {
        Eigen::MatrixXd covariance = squares / count;
        covariance.diagonal() = (1 + seen.shrinkage) * covariance.diagonal() + seen.variance;
        return inverse_factor(covariance);
    };
    std::vector<double> distances;
    for (const Eigen::MatrixXd& group : residual) {
        const double others = rows - double(group.rows());
        const Eigen::MatrixXd whitening =
            others > 0 ? whitening_of(all - group.transpose() * group, others) : whitening_of(all, rows);
        const Eigen::VectorXd of_group = (group * whitening.transpose()).rowwise().norm();
        distances.insert(distances.end(), of_group.begin(), of_group.end());
    }
    std::sort(distances.begin(), distances.end());
    const auto at = std::size_t(std::ceil(kQuantile * double(distances.size()))) - 1;
    const double noise = std::sqrt(double(n) + 3.1 * std::sqrt(2.0 * double(n)));  // the limit of the joint domain
    const Surface surface = surface_of(seen.channel, m);
    const auto inverse_unit = seen.unit.cwiseInverse().asDiagonal();
    CurvedDomain domain;
    domain.directions = rows_in(surface.directions.transpose() * inverse_unit);
    domain.feature_mean.assign(surface.feature_mean.begin(), surface.feature_mean.end());
    domain.feature_whitening = triangle_in(surface.feature_whitening);
    domain.growth = 1 / double(surface.feature_mean.size());
    domain.coefficients = rows_in(seen.unit.asDiagonal() * surface.coefficients.transpose());
    domain.whitening = triangle_in(whitening_of(all, rows) * inverse_unit);
    domain.limit = std::max(noise, kMargin * distances[at]);
    if (!std::isfinite(domain.limit)) return {};
    domain.false_alarms = double(distances.end() - std::upper_bound(distances.begin(), distances.end(), domain.limit)) /
                          double(distances.size());
    return domain;
}

// Readings in which one channel has the value of another row, so that a component moves by kHarm although the estimate is
// GOOD without a check. The joint domain accepts all of them.
struct Harmful {
    std::vector<std::vector<double>> readings;
    std::size_t damaged = 0;  // number of readings that were made
};

Harmful harmful_damage(const Rows& rows, const Calibration& calibration) {
    Calibration plain = calibration;
    plain.joint_domain = {};
    const auto decoupler = make_decoupler(plain);
    const auto estimate = [&](const std::vector<double>& channel) {
        decoupler->forget();
        return decoupler->decouple({.channel = channel});
    };
    std::mt19937 random(1);
    Harmful harmful;
    const std::size_t step = std::max<std::size_t>(1, rows.size() / kDamagedRows);
    for (std::size_t i = 0; i < rows.size(); i += step) {
        const Wrench sound = estimate(rows[i]->channel).wrench_S;
        for (std::size_t k = 0; k < rows[i]->channel.size(); ++k, ++harmful.damaged) {
            std::vector<double> channel = rows[i]->channel;
            channel[k] = rows[random() % rows.size()]->channel[k];
            if (joint_distance(calibration.joint_domain, channel) > calibration.joint_domain.limit) continue;
            const Estimate off = estimate(channel);
            bool is_harmful = false;
            for (std::size_t c = 0; c < calibration.components.size(); ++c) {
                const std::size_t at = component_index(calibration.components[c]);
                is_harmful = is_harmful || std::abs(off.wrench_S[at] - sound[at]) > kHarm * calibration.full_scale[c];
            }
            if (is_harmful && off.quality() == TACTILED_GOOD) harmful.readings.push_back(std::move(channel));
        }
    }
    return harmful;
}

}  // namespace

void set_curved_domain(const Rows& rows, const std::vector<std::size_t>& group_of_row, const std::vector<double>& zero_sd,
                       Calibration& calibration) {
    JointDomain& domain = calibration.joint_domain;
    domain.curved = {};
    const std::size_t n = calibration.channels.size();
    Seen seen{.channel = channels_of(rows),
              .unit = {},
              .variance = Eigen::VectorXd(Eigen::Index(n)),
              .groups = {},
              .loads = loads_of(rows).back() + 1,
              .shrinkage = 0};
    seen.unit = (seen.channel.colwise().maxCoeff() - seen.channel.colwise().minCoeff()) / 4;
    if (!(seen.unit.minCoeff() > 0)) return;
    seen.channel = seen.channel.array().rowwise() / seen.unit.array();
    std::set<std::size_t> sessions;
    for (const auto* row : rows) sessions.insert(row->session);
    const bool is_one = sessions.size() == 1;
    const double floor = is_one ? kFloorOfOneSession : kFloor;
    seen.shrinkage = is_one ? kShrinkageOfOneSession : kShrinkage / double(sessions.size());
    for (std::size_t k = 0; k < n; ++k)
        seen.variance[Eigen::Index(k)] = floor * floor + std::pow(zero_sd[k] / seen.unit[Eigen::Index(k)], 2);
    for (const std::size_t group : std::set<std::size_t>(group_of_row.begin(), group_of_row.end())) {
        seen.groups.emplace_back();
        for (std::size_t i = 0; i < rows.size(); ++i)
            if (group_of_row[i] == group) seen.groups.back().push_back(Eigen::Index(i));
    }
    const Harmful harmful = harmful_damage(rows, calibration);
    if (double(harmful.readings.size()) < kLeastHarmful * double(harmful.damaged)) return;
    CurvedDomain best;
    double least = kWorth * double(harmful.readings.size());
    const std::size_t n_components = calibration.components.size();
    for (std::size_t m = n_components; m <= std::max(n_components, kEnoughDirections) && m + 2 <= n; ++m) {
        JointDomain one = domain;
        one.curved = domain_of(seen, Eigen::Index(m));
        if (one.curved.limit == 0 || one.curved.false_alarms > kMaxFalseAlarms) continue;
        const CurvedDistance distance(one);
        const auto inside = double(std::count_if(harmful.readings.begin(), harmful.readings.end(), [&](const auto& channel) {
            return distance.squared(channel.data()) <= 1;
        }));
        if (!(inside < least)) continue;
        least = inside;
        best = std::move(one.curved);
    }
    domain.curved = std::move(best);
}

}  // namespace tactiled
