#include "decoupling/fit/domain_fit.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "decoupling/fit/labels.hpp"
#include "decoupling/joint_domain.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kQuantile = 0.999, kMargin = 1.1;
// Added to the variance of each channel, whose unit is a quarter of the channel's range: noise and drift of 0.25 % of the
// range, which a recording of averaged loads does not show.
constexpr double kFloor = 1e-4;

// Returns the change of each channel with each labelled component, times the component's full scale, one row per
// component. Least squares over the rows with all labels.
Eigen::MatrixXd responses(const Rows& rows, const Eigen::MatrixXd& channel, const Calibration& calibration) {
    const std::vector<std::size_t> component = component_indices(calibration.components);
    std::vector<Eigen::Index> whole;
    for (std::size_t i = 0; i < rows.size(); ++i)
        if (std::all_of(component.begin(), component.end(),
                        [&](std::size_t c) { return std::isfinite(rows[i]->wrench_S[c]); }))
            whole.push_back(Eigen::Index(i));
    const auto m = Eigen::Index(component.size());
    if (Eigen::Index(whole.size()) < 3 * (m + 1)) return Eigen::MatrixXd(0, channel.cols());
    Eigen::MatrixXd load(Eigen::Index(whole.size()), m), at = Eigen::MatrixXd(load.rows(), channel.cols());
    for (Eigen::Index i = 0; i < load.rows(); ++i) {
        at.row(i) = channel.row(whole[std::size_t(i)]);
        for (Eigen::Index c = 0; c < m; ++c)
            load(i, c) = rows[std::size_t(whole[std::size_t(i)])]->wrench_S[component[std::size_t(c)]];
    }
    const Eigen::RowVectorXd full_scale = load.cwiseAbs().colwise().maxCoeff().cwiseMax(1e-300);
    load = (load.array().rowwise() / full_scale.array()).matrix();
    load.rowwise() -= load.colwise().mean().eval();
    at.rowwise() -= at.colwise().mean().eval();
    // Components that always occurred together share their response.
    const Eigen::MatrixXd squares = load.transpose() * load;
    const double ridge = 1e-6 * std::max(squares.diagonal().maxCoeff(), 1e-300);
    return dense::solve_by_ldlt(squares + ridge * Eigen::MatrixXd::Identity(m, m), load.transpose() * at);
}

// Returns the domain without its limit.
JointDomain domain_of(const Rows& rows, const std::vector<double>& zero_sd, const Calibration& calibration) {
    const auto n = Eigen::Index(calibration.channels.size());
    Eigen::MatrixXd channel = channels_of(rows);
    Eigen::RowVectorXd unit = (channel.colwise().maxCoeff() - channel.colwise().minCoeff()) / 4;
    unit = (unit.array() > 0).select(unit, 1.0);
    channel = (channel.array().rowwise() / unit.array()).matrix();
    const Eigen::RowVectorXd mean = channel.colwise().mean();
    channel.rowwise() -= mean;
    Eigen::MatrixXd covariance = channel.transpose() * channel / double(channel.rows());
    // Loads that occur one after the other in the rows may occur together: they belong to the domain up to the full
    // scale of each component.
    const Eigen::MatrixXd response = responses(rows, channel, calibration);
    covariance += double(std::max<Eigen::Index>(1, response.rows())) * response.transpose() * response;
    covariance.diagonal().array() += kFloor;
    for (Eigen::Index k = 0; k < n; ++k) covariance(k, k) += std::pow(zero_sd[std::size_t(k)] / unit[k], 2);
    const Eigen::MatrixXd whitening = dense::solve_lower(dense::lower_factor(covariance), Eigen::MatrixXd::Identity(n, n)) *
                                      unit.cwiseInverse().asDiagonal();
    JointDomain domain;
    for (Eigen::Index i = 0; i < n; ++i) {
        domain.mean.push_back(mean[i] * unit[i]);
        domain.whitening.emplace_back();
        for (Eigen::Index k = 0; k <= i; ++k) domain.whitening.back().push_back(whitening(i, k));
    }
    return domain;
}

}  // namespace

std::vector<double> zeros_of(const Rows& rows, const Calibration& calibration) {
    const Eigen::MatrixXd channel = channels_of(rows);
    std::vector<double> sd(calibration.channels.size());
    for (std::size_t k = 0; k < sd.size(); ++k) {
        const double width = channel.col(Eigen::Index(k)).maxCoeff() - channel.col(Eigen::Index(k)).minCoeff();
        const double beyond = calibration.channel_most[k] - calibration.channel_least[k] - width;
        sd[k] = std::hypot(std::max(0.0, beyond) / 2, calibration.zero_drift.empty() ? 0.0 : calibration.zero_drift[k]);
    }
    return sd;
}

void set_joint_domain(const Rows& rows, const std::vector<std::size_t>& group_of_row, Calibration& calibration) {
    calibration.joint_domain = {};
    const std::size_t n = calibration.channels.size();
    const auto is_enough = [&](std::size_t count) { return count >= kRowsPerCoefficient * (n + 1); };
    if (n < 2 || !is_enough(rows.size())) return;
    const std::vector<double> zero_sd = zeros_of(rows, calibration);
    std::vector<double> distances;
    for (const std::size_t group : std::set<std::size_t>(group_of_row.begin(), group_of_row.end())) {
        Rows seen, unseen;
        for (std::size_t i = 0; i < rows.size(); ++i) (group_of_row[i] == group ? unseen : seen).push_back(rows[i]);
        if (!is_enough(seen.size())) continue;
        const JointDomain part = domain_of(seen, zero_sd, calibration);
        for (const auto* row : unseen) distances.push_back(joint_distance(part, row->channel));
    }
    if (distances.empty()) return;
    std::sort(distances.begin(), distances.end());
    JointDomain domain = domain_of(rows, zero_sd, calibration);
    const auto at = std::size_t(std::ceil(kQuantile * double(distances.size()))) - 1;
    // 99.9 % of normal noise with kFloor in all channels: averaged loads have less noise than a sample in use.
    const double noise = std::sqrt(double(n) + 3.1 * std::sqrt(2.0 * double(n)));
    domain.limit = std::hypot(1, std::max(noise, kMargin * distances[at]));  // 1: all components at full scale
    if (!std::isfinite(domain.limit) || domain.limit <= 0) return;
    domain.false_alarms = double(distances.end() - std::upper_bound(distances.begin(), distances.end(), domain.limit)) /
                          double(distances.size());
    calibration.joint_domain = std::move(domain);
    set_curved_domain(rows, group_of_row, zero_sd, calibration);
}

}  // namespace tactiled
