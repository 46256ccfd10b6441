#include "decoupling/fit/recording_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/mixed_effects.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kKnown = 0.02;     // relative to a channel's width: uncertainty of a zero
constexpr double kLower = 0.7;      // error with own zeros over error with one zero
constexpr double kExplains = 0.3;   // relative to the labels' spread
constexpr double kWorth = 1e-4;     // relative to full scale: a smaller difference does not count
constexpr std::size_t kParts = 10;  // groups of sessions to leave out

struct Data {
    Eigen::MatrixXd channel, label;    // rows x channels, rows x components
    std::vector<std::size_t> session;  // number of the session among those that occur
    Eigen::RowVectorXd full_scale, width;
};

// Returns the mean over the components of the 68 % quantile of the errors of an affine map on left-out sessions,
// relative to full scale; infinite if the others do not determine a map.
double error_of_affine(const Data& data, const Eigen::MatrixXd& channel, const std::vector<bool>& agrees) {
    const std::size_t parts = std::min(kParts, 1 + *std::max_element(data.session.begin(), data.session.end()));
    std::vector<std::vector<double>> errors(std::size_t(data.label.cols()));
    for (std::size_t part = 0; part < parts; ++part) {
        std::vector<Eigen::Index> seen, unseen;
        for (Eigen::Index i = 0; i < channel.rows(); ++i)
            if (agrees[std::size_t(i)]) (data.session[std::size_t(i)] % parts == part ? unseen : seen).push_back(i);
        const auto n = Eigen::Index(seen.size());
        if (n <= channel.cols() + 1) return std::numeric_limits<double>::infinity();
        Eigen::MatrixXd x(n, channel.cols()), y(n, data.label.cols());
        for (Eigen::Index i = 0; i < n; ++i) {
            x.row(i) = channel.row(seen[std::size_t(i)]);
            y.row(i) = data.label.row(seen[std::size_t(i)]);
        }
        const Eigen::RowVectorXd x_mean = x.colwise().mean(), y_mean = y.colwise().mean();
        const Eigen::MatrixXd scaled = (x.rowwise() - x_mean).array().rowwise() / data.width.array();
        const Eigen::MatrixXd slope = dense::least_norm(scaled, y.rowwise() - y_mean);
        for (const Eigen::Index i : unseen) {
            const Eigen::RowVectorXd error =
                (channel.row(i) - x_mean).cwiseQuotient(data.width) * slope + y_mean - data.label.row(i);
            for (Eigen::Index c = 0; c < error.size(); ++c) errors[std::size_t(c)].push_back(std::abs(error[c]));
        }
    }
    double sum = 0;
    for (std::size_t c = 0; c < errors.size(); ++c) {
        if (errors[c].empty()) return std::numeric_limits<double>::infinity();
        const auto at = errors[c].begin() + std::ptrdiff_t(0.683 * double(errors[c].size()));
        std::nth_element(errors[c].begin(), at, errors[c].end());
        sum += *at / data.full_scale[Eigen::Index(c)];
    }
    return sum / double(errors.size());
}

}  // namespace

SessionZeros session_zeros(const Labelled& labelled, const Rows& rows, FitRequest::Zeros requested) {
    SessionZeros zeros;
    if (labelled.sessions.size() < 2) return zeros;
    const MixedEffects effects = mixed_effects(labelled, rows);
    const std::size_t sessions = effects.index.size();
    if (sessions < 2 || effects.rows.empty()) return zeros;
    Data data{.channel = channels_of(effects.rows),
              .label = labels_of(effects.rows, effects.components),
              .session = effects.session,
              .full_scale = {},
              .width = {}};
    data.full_scale = data.label.cwiseAbs().colwise().maxCoeff();
    data.width = data.channel.colwise().maxCoeff() - data.channel.colwise().minCoeff();
    zeros.offset.resize(labelled.sessions.size());
    for (std::size_t s = 0; s < sessions; ++s) {
        const Eigen::RowVectorXd zero = effects.session_zero.row(Eigen::Index(s));
        zeros.offset[effects.index[s]].assign(zero.begin(), zero.end());
    }
    bool known = true;  // most of them: one session without a small load does not count for all
    for (Eigen::Index k = 0; k < data.width.size(); ++k) {
        const Eigen::VectorXd own_sd = effects.own_sd.col(k);
        known = known && median({own_sd.begin(), own_sd.end()}) <= kKnown * data.width[k];
    }
    if (known) zeros.sd.assign(effects.zero_sd.begin(), effects.zero_sd.end());
    Eigen::MatrixXd tared = data.channel;
    for (Eigen::Index i = 0; i < tared.rows(); ++i)
        tared.row(i) -= effects.session_zero.row(Eigen::Index(data.session[std::size_t(i)]));
    zeros.error = error_of_affine(data, data.channel, effects.agrees);
    zeros.error_with_own = error_of_affine(data, tared, effects.agrees);
    // Zeros are not an explanation if the channels do not determine the labels even with them.
    const Eigen::RowVectorXd spread =
        ((data.label.rowwise() - data.label.colwise().mean()).colwise().squaredNorm() / double(data.label.rows()))
            .cwiseSqrt()
            .cwiseQuotient(data.full_scale);
    const bool explains = zeros.error_with_own < kExplains * spread.mean();
    zeros.own = requested == FitRequest::Zeros::per_session ||
                (requested == FitRequest::Zeros::found && known && explains && zeros.error_with_own < kLower * zeros.error &&
                 zeros.error - zeros.error_with_own > kWorth);
    return zeros;
}

void take_zeros_off(const SessionZeros& zeros, Labelled& labelled) {
    for (LabelledRow& row : labelled.rows) {
        if (row.session >= zeros.offset.size()) continue;
        const std::vector<double>& offset = zeros.offset[row.session];
        for (std::size_t k = 0; k < offset.size(); ++k) row.channel[k] -= offset[k];
    }
}

ZeroDrift zero_drift_of(const FitRequest& request, const Rows& rows, const SessionZeros& zeros) {
    if (!request.zero_drift) return {.sd = zeros.own ? std::vector<double>{} : zeros.sd, .stated = false};
    Calibration domain;
    domain.channels.resize(rows.front()->channel.size());
    set_domain(rows, domain);
    std::vector<double> drift;
    for (std::size_t k = 0; k < domain.channels.size(); ++k)
        drift.push_back(*request.zero_drift * (domain.channel_most[k] - domain.channel_least[k]));
    return {.sd = *request.zero_drift > 0 ? drift : std::vector<double>{}, .stated = true};
}

void say_zeros(const Labelled& labelled, const SessionZeros& zeros, const Calibration& calibration,
               std::vector<std::string>& warnings) {
    if (zeros.sd.empty()) return;
    double greatest = 0;
    std::size_t channel = 0;
    for (std::size_t k = 0; k < zeros.sd.size(); ++k) {
        const double part = zeros.sd[k] / (calibration.channel_most[k] - calibration.channel_least[k]);
        if (!(part > greatest)) continue;
        greatest = part;
        channel = k;
    }
    const std::string scatter =
        fmt::format("scatter by up to {:.2g} % of a channel's width (sd, {})", 100 * greatest, labelled.channels[channel]);
    if (zeros.own)
        warnings.push_back(fmt::format(
            "each session has its own zero: they {}. An affine map errs by {:.2g} % of full scale with one zero for all and "
            "by {:.2g} % with one for each (68 % of the errors). The calibration and its error are those after a tare: tare "
            "after each mounting",
            scatter, 100 * zeros.error, 100 * zeros.error_with_own));
    else
        warnings.push_back(
            fmt::format("zero drift: the zeros of the sessions {}; the fit and the standard deviation allow "
                        "for it",
                        scatter));
}

}  // namespace tactiled
