#include "decoupling/fit/domain_fit.hpp"
#include "decoupling/fit/labels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "decoupling/fit/groups.hpp"
#include "decoupling/parity.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kNoise = 1e-3;  // share of a channel's range: noise and drift that a recording of held loads does not show
constexpr double kWorth = 0.7;   // maximum error of a quadratic prediction, relative to a linear one
constexpr double kRedundant = 0.05;  // maximum sd of a residual, relative to the channel's range
// The 99.9 % quantile of normal numbers is 3.29 standard deviations.
constexpr double kTail = 0.999, kTail_sd = 3.29;
constexpr double kRidge = 1e-10;
constexpr std::size_t kMaxChannelsOfOrder2 = 8;
constexpr std::size_t kRowsOfShift = 100;  // rows for which the shift of the components is computed
constexpr double kMaxFalseAlarms = 0.01;   // share of held-out rows; above it the calibration gets no parity

Eigen::MatrixXd features_of(const Rows& rows, const Parity& parity) {
    const std::size_t n = rows.front()->channel.size();
    Eigen::MatrixXd features(Eigen::Index(rows.size()), Eigen::Index(parity_features(n, parity.order)));
    std::vector<double> feature(std::size_t(features.cols()));
    for (std::size_t i = 0; i < rows.size(); ++i) {
        put_features(parity, rows[i]->channel, feature.data());
        features.row(Eigen::Index(i)) = Eigen::Map<const Eigen::RowVectorXd>(feature.data(), features.cols());
    }
    return features;
}

std::vector<Eigen::Index> features_without(std::size_t n, int order, std::size_t k) {
    std::vector<Eigen::Index> index{0};
    for (std::size_t i = 0; i < n; ++i)
        if (i != k) index.push_back(Eigen::Index(1 + i));
    auto at = Eigen::Index(1 + n);
    for (std::size_t i = 0; order > 1 && i < n; ++i)
        for (std::size_t j = i; j < n; ++j, ++at)
            if (i != k && j != k) index.push_back(at);
    return index;
}

// Coefficients of all channels, one column per channel, by ridge regression on the rows of `features`.
Eigen::MatrixXd coefficients_of(const Eigen::MatrixXd& features, const Eigen::MatrixXd& channel, int order) {
    const auto n = std::size_t(channel.cols());
    const Eigen::MatrixXd squares = features.transpose() * features, products = features.transpose() * channel;
    Eigen::MatrixXd coefficients = Eigen::MatrixXd::Zero(features.cols(), channel.cols());
    for (std::size_t k = 0; k < n; ++k) {
        const auto index = features_without(n, order, k);
        const auto m = Eigen::Index(index.size());
        Eigen::MatrixXd a(m, m);
        Eigen::VectorXd b(m);
        for (Eigen::Index i = 0; i < m; ++i) {
            b[i] = products(index[std::size_t(i)], Eigen::Index(k));
            for (Eigen::Index j = 0; j < m; ++j) a(i, j) = squares(index[std::size_t(i)], index[std::size_t(j)]);
        }
        a.diagonal().array() += kRidge * double(features.rows());
        const Eigen::VectorXd solved = dense::solve_by_ldlt(a, b);
        for (Eigen::Index i = 0; i < m; ++i) coefficients(index[std::size_t(i)], Eigen::Index(k)) = solved[i];
    }
    return coefficients;
}

constexpr std::size_t kNoGroup = std::size_t(-1);

// Returns the standard deviation of residuals, rms or tail, without those of group `left_out`; NaN if there is none.
double size_of(const Eigen::VectorXd& residual, const std::vector<std::size_t>& group_of_row, std::size_t left_out) {
    std::vector<double> sizes;
    double squares = 0;
    for (Eigen::Index i = 0; i < residual.size(); ++i)
        if (group_of_row[std::size_t(i)] != left_out && std::isfinite(residual[i])) {
            sizes.push_back(std::abs(residual[i]));
            squares += residual[i] * residual[i];
        }
    if (sizes.empty()) return kNaN;
    return std::max(std::sqrt(squares / double(sizes.size())), quantile(sizes, kTail) / kTail_sd);
}

struct HeldOutParity {
    Parity parity;
    double error = 0;  // held out, geometric mean over the channels of rms / range
    // [row][channel]: held-out residual, and its limit with the standard deviations of the other groups; channel_unit
    Eigen::MatrixXd residual, limit;
};

HeldOutParity fit_order(const Rows& rows, const std::vector<std::size_t>& group_of_row, const Calibration& calibration,
                        Parity parity) {
    const std::size_t n = calibration.channels.size();
    const Eigen::MatrixXd features = features_of(rows, parity);
    const Eigen::MatrixXd channel = channels_of(rows);
    const std::set<std::size_t> groups(group_of_row.begin(), group_of_row.end());
    Eigen::MatrixXd residual = Eigen::MatrixXd::Constant(channel.rows(), channel.cols(), kNaN);
    for (const std::size_t group : groups) {
        std::vector<Eigen::Index> seen, unseen;
        for (std::size_t i = 0; i < rows.size(); ++i) (group_of_row[i] == group ? unseen : seen).push_back(Eigen::Index(i));
        if (Eigen::Index(seen.size()) < features.cols()) continue;
        const Eigen::MatrixXd part = coefficients_of(features(seen, Eigen::all), channel(seen, Eigen::all), parity.order);
        const Eigen::MatrixXd errors = channel(unseen, Eigen::all) - features(unseen, Eigen::all) * part;
        for (std::size_t i = 0; i < unseen.size(); ++i) residual.row(unseen[i]) = errors.row(Eigen::Index(i));
    }
    const Eigen::MatrixXd coefficients = coefficients_of(features, channel, parity.order);
    const std::vector<double> zero_sd = zeros_of(rows, calibration);
    HeldOutParity result;
    result.limit = residual;
    for (std::size_t k = 0; k < n; ++k) {
        // Noise and drift of each channel, through the linear coefficients.
        double others = 0;
        for (std::size_t j = 0; j < n; ++j) {
            const double gain = j == k ? 1 : coefficients(Eigen::Index(1 + j), Eigen::Index(k)) / parity.scale[j];
            others += std::pow(gain * std::hypot(zero_sd[j], kNoise * 2 * parity.scale[j]), 2);
        }
        const Eigen::VectorXd column = residual.col(Eigen::Index(k));
        const double sd = std::hypot(size_of(column, group_of_row, kNoGroup), std::sqrt(others));
        if (!std::isfinite(sd)) return {};
        parity.sd.push_back(sd <= kRedundant * 2 * parity.scale[k] ? sd : 0);
        parity.coefficients.emplace_back();
        for (Eigen::Index f = 0; f < coefficients.rows(); ++f)
            parity.coefficients.back().push_back(coefficients(f, Eigen::Index(k)));
        result.error += std::log(std::max(sd / (2 * parity.scale[k]), 1e-12)) / double(n);
        for (const std::size_t group : groups) {
            const double of_others = size_of(column, group_of_row, group);
            const double limit = kParityLimit * std::hypot(std::isfinite(of_others) ? of_others : sd, std::sqrt(others));
            for (std::size_t i = 0; i < rows.size(); ++i)
                if (group_of_row[i] == group) result.limit(Eigen::Index(i), Eigen::Index(k)) = limit;
        }
    }
    result.error = std::exp(result.error);
    result.residual = residual;
    result.parity = std::move(parity);
    return result;
}

// Returns for each channel the residual that shifts some component by its sd: rms over rows of a shift of kLimit sd of the
// residual.
std::vector<double> harmless_residuals(const Rows& rows, const Calibration& plain, const Parity& parity) {
    std::vector<double> result(parity.sd.size());
    if (plain.sd.empty()) return result;
    const auto decoupler = make_decoupler(plain);
    const std::size_t step = std::max<std::size_t>(1, rows.size() / kRowsOfShift);
    for (std::size_t k = 0; k < result.size(); ++k) {
        if (parity.sd[k] == 0) continue;
        Wrench squares{};
        double count = 0;
        const double residual = kParityLimit * parity.sd[k];
        for (std::size_t i = 0; i < rows.size(); i += step, ++count) {
            std::vector<double> channel = rows[i]->channel;
            const auto estimate = [&] {
                decoupler->forget();
                return decoupler->decouple({.channel = channel, .t_ns = rows[i]->t_ns});
            };
            const Estimate before = estimate();
            channel[k] += residual;
            const Estimate after = estimate();
            for (std::size_t c = 0; c < squares.size(); ++c)
                if (const double shift = (after.wrench_S[c] - before.wrench_S[c]) / before.sd[c]; std::isfinite(shift))
                    squares[c] += shift * shift;
        }
        const double shift = std::sqrt(*std::max_element(squares.begin(), squares.end()) / count);
        // A channel that moves no component: any residual within its range is harmless.
        result[k] = std::min(2 * parity.scale[k], residual / std::max(shift, 1e-9));
    }
    return result;
}

}  // namespace

void set_parity(const Rows& rows, const std::vector<std::size_t>& group_of_row, Calibration& calibration,
                std::vector<std::string>& warnings) {
    calibration.parity = {};
    const std::size_t n = calibration.channels.size();
    if (n < 2 || rows.empty()) return;
    const std::size_t loads = loads_of(rows).back() + 1;
    Parity parity;
    const Eigen::MatrixXd channel = channels_of(rows);
    for (Eigen::Index k = 0; k < channel.cols(); ++k) {
        const double least = channel.col(k).minCoeff(), most = channel.col(k).maxCoeff();
        parity.centre.push_back((least + most) / 2);
        parity.scale.push_back((most - least) / 2);
        if (!(parity.scale.back() > 0)) return;
    }
    HeldOutParity best;
    for (const int order : {1, 2}) {
        if (order == 2 && n > kMaxChannelsOfOrder2) break;
        if (loads < kRowsPerCoefficient * parity_features(n - 1, order)) break;
        parity.order = order;
        HeldOutParity one = fit_order(rows, group_of_row, calibration, parity);
        if (one.parity.sd.empty()) break;
        if (best.parity.sd.empty() || one.error < kWorth * best.error) best = std::move(one);
    }
    const auto& sd = best.parity.sd;
    if (std::all_of(sd.begin(), sd.end(), [](double each) { return each == 0; })) return;
    Calibration plain = calibration;  // without the check
    plain.joint_domain = {};
    const std::vector<double> harmless = harmless_residuals(rows, plain, best.parity);
    std::size_t off = 0;
    std::uint32_t recent = 0;
    for (Eigen::Index i = 0; i < best.residual.rows(); ++i) {
        bool is_off = false;
        for (std::size_t k = 0; k < n; ++k)
            is_off = is_off || (sd[k] > 0 && std::abs(best.residual(i, Eigen::Index(k))) >
                                                 std::max(best.limit(i, Eigen::Index(k)), harmless[k]));
        off += parity_alarm(recent, is_off);
    }
    best.parity.false_alarms = double(off) / double(rows.size());
    if (best.parity.false_alarms > kMaxFalseAlarms) {
        warnings.push_back(fmt::format(
            "no parity: {:.1f} % of the held-out rows raise an alarm, since channels disagree with their predictions",
            100 * best.parity.false_alarms));
        return;
    }
    calibration.parity = std::move(best.parity);
}

void set_parity_of_method(const Rows& rows, Calibration& calibration) {
    calibration.sd_without.clear();
    calibration.parity_harmless.clear();
    const Parity& parity = calibration.parity;
    if (parity.sd.empty()) return;
    Calibration plain = calibration;  // without the check
    plain.parity = {};
    plain.joint_domain = {};
    calibration.parity_harmless = harmless_residuals(rows, plain, parity);
    for (std::size_t k = 0; k < parity.sd.size(); ++k) {
        const auto decoupler = make_decoupler(plain);
        std::vector<double> squares(calibration.components.size()), count(calibration.components.size());
        for (const auto* row : rows) {
            if (parity.sd[k] == 0) break;
            std::vector<double> channel = row->channel;
            channel[k] = predicted(parity, row->channel, k);
            const Estimate estimate = decoupler->decouple({.channel = channel, .t_ns = row->t_ns});
            for (std::size_t i = 0; i < squares.size(); ++i) {
                const std::size_t c = component_index(calibration.components[i]);
                const double error = estimate.wrench_S[c] - row->wrench_S[c];
                if (!std::isfinite(error)) continue;
                squares[i] += error * error;
                ++count[i];
            }
        }
        calibration.sd_without.emplace_back();
        for (std::size_t i = 0; i < squares.size(); ++i)
            calibration.sd_without.back().push_back(count[i] > 0 ? std::sqrt(squares[i] / count[i]) : 0);
    }
}

}  // namespace tactiled
