#include "decoupling/fit/recording_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kRest = 0.02;      // relative to each component's full scale
constexpr double kStraight = 0.02;  // relative to a channel's width: allowed residual of the affine map of the labels
constexpr double kLower = 0.7;      // error with own zeros over error with one zero
constexpr double kExplains = 0.3;   // relative to the labels' spread
constexpr double kWorth = 1e-4;     // relative to full scale: a smaller difference does not count
constexpr std::size_t kParts = 10;  // groups of sessions to leave out
constexpr int kRounds = 3;
constexpr double kFarOff = 10;  // relative to the median residual of the zeros

struct Data {
    Eigen::MatrixXd channel, label;    // rows x channels, rows x components
    std::vector<std::size_t> session;  // number of the session among those that occur
    std::vector<std::size_t> index;    // index in Labelled::sessions of each number
    Eigen::RowVectorXd full_scale, width;
};

// Returns the rows that have all labels of the recording.
Data data_of(const Labelled& labelled, const Rows& rows) {
    Data data;
    std::vector<std::size_t> components;
    for (std::size_t c = 0; c < 6; ++c)
        if (std::any_of(rows.begin(), rows.end(), [&](const auto* row) { return std::isfinite(row->wrench_S[c]); }))
            components.push_back(c);
    const Rows whole = rows_with(rows, components);
    if (whole.empty()) return data;
    data.channel = channels_of(whole);
    data.label = labels_of(whole, components);
    std::vector<std::size_t> number(labelled.sessions.size(), labelled.sessions.size());
    for (const auto* row : whole) {
        if (number[row->session] == labelled.sessions.size()) {
            number[row->session] = data.index.size();
            data.index.push_back(row->session);
        }
        data.session.push_back(number[row->session]);
    }
    data.full_scale = data.label.cwiseAbs().colwise().maxCoeff();
    data.width = data.channel.colwise().maxCoeff() - data.channel.colwise().minCoeff();
    return data;
}

// Returns means over the rows of each session; NaN where no row is `counted`.
Eigen::MatrixXd means_of_sessions(const Data& data, const Eigen::MatrixXd& of, const std::vector<bool>& counted) {
    Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(Eigen::Index(data.index.size()), of.cols());
    Eigen::VectorXd n = Eigen::VectorXd::Zero(mean.rows());
    for (Eigen::Index i = 0; i < of.rows(); ++i) {
        if (!counted[std::size_t(i)]) continue;
        mean.row(Eigen::Index(data.session[std::size_t(i)])) += of.row(i);
        n[Eigen::Index(data.session[std::size_t(i)])] += 1;
    }
    return mean.array().colwise() / n.array();
}

struct Zeros {
    Eigen::MatrixXd of_session;  // one row per session
    std::vector<bool> agrees;    // for each row of the data: false if no zero explains it, as with a mistyped label
    bool known = false;          // from rows at rest or linear channels, not from loads of a nonlinear sensor
};

// Determines the zeros from rows at rest, if each session has some and the channels are not linear, else from all
// rows. Rows with a far larger residual than the others are ignored in the next iteration.
Zeros zeros_of(const Data& data) {
    Zeros zeros{.of_session = {}, .agrees = std::vector<bool>(data.session.size(), true)};
    for (int round = 0; round < kRounds; ++round) {
        const Eigen::MatrixXd channel_mean = means_of_sessions(data, data.channel, zeros.agrees);
        const Eigen::MatrixXd label_mean = means_of_sessions(data, data.label, zeros.agrees);
        Eigen::MatrixXd channel = data.channel, label = data.label;
        for (Eigen::Index i = 0; i < channel.rows(); ++i) {
            const double counts = zeros.agrees[std::size_t(i)] ? 1 : 0;
            channel.row(i) = counts * (channel.row(i) - channel_mean.row(Eigen::Index(data.session[std::size_t(i)])));
            label.row(i) = counts * (label.row(i) - label_mean.row(Eigen::Index(data.session[std::size_t(i)])));
        }
        if (!channel.allFinite()) return zeros;                          // a session has lost all of its rows
        const Eigen::MatrixXd gain = dense::least_norm(label, channel);  // components x channels
        const Eigen::RowVectorXd left =
            ((channel - label * gain).colwise().squaredNorm() / double(channel.rows())).cwiseSqrt();
        const bool straight = ((left.array() / data.width.array()) <= kStraight).all();
        const Eigen::MatrixXd at_rest = data.channel - data.label * gain;
        zeros.of_session = means_of_sessions(data, at_rest, zeros.agrees);
        if (!straight) {
            std::vector<bool> rests = zeros.agrees;
            for (Eigen::Index i = 0; i < data.label.rows(); ++i)
                rests[std::size_t(i)] =
                    rests[std::size_t(i)] && (data.label.row(i).array().abs() <= kRest * data.full_scale.array()).all();
            const Eigen::MatrixXd resting = means_of_sessions(data, at_rest, rests);
            zeros.known = resting.allFinite();
            if (zeros.known) zeros.of_session = resting;
        } else {
            zeros.known = true;
        }
        std::vector<double> size;
        for (Eigen::Index i = 0; i < at_rest.rows(); ++i)
            size.push_back((at_rest.row(i) - zeros.of_session.row(Eigen::Index(data.session[std::size_t(i)])))
                               .cwiseQuotient(data.width)
                               .norm());
        const double limit = kFarOff * median(size);
        for (std::size_t i = 0; i < size.size(); ++i) zeros.agrees[i] = size[i] <= limit;
    }
    return zeros;
}

// Returns the mean over the components of the 68 % quantile of the errors of an affine map on left-out sessions,
// relative to full scale; infinite if the others do not determine a map.
double error_of_affine(const Data& data, const Eigen::MatrixXd& channel, const std::vector<bool>& agrees) {
    const std::size_t parts = std::min(kParts, data.index.size());
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
    const Data data = data_of(labelled, rows);
    const std::size_t sessions = data.index.size();
    if (sessions < 2 || data.session.size() <= data.index.size() + std::size_t(data.label.cols()) ||
        !(data.width.minCoeff() > 0) || !(data.full_scale.minCoeff() > 0))
        return zeros;
    const Zeros found = zeros_of(data);
    Eigen::MatrixXd zero = found.of_session;
    if (zero.size() == 0) return zeros;
    zero.rowwise() -= Eigen::RowVectorXd(zero.colwise().mean());
    if (!zero.allFinite()) return zeros;
    zeros.offset.resize(labelled.sessions.size());
    for (std::size_t s = 0; s < sessions; ++s) {
        const Eigen::RowVectorXd row = zero.row(Eigen::Index(s));
        zeros.offset[data.index[s]].assign(row.data(), row.data() + row.size());
    }
    const Eigen::RowVectorXd sd = (zero.colwise().squaredNorm() / double(sessions - 1)).cwiseSqrt();
    if (found.known) zeros.sd.assign(sd.data(), sd.data() + sd.size());
    Eigen::MatrixXd tared = data.channel;
    for (Eigen::Index i = 0; i < tared.rows(); ++i) tared.row(i) -= zero.row(Eigen::Index(data.session[std::size_t(i)]));
    zeros.error = error_of_affine(data, data.channel, found.agrees);
    zeros.error_with_own = error_of_affine(data, tared, found.agrees);
    // Zeros are not an explanation if the channels do not determine the labels even with them.
    const Eigen::RowVectorXd spread =
        ((data.label.rowwise() - data.label.colwise().mean()).colwise().squaredNorm() / double(data.label.rows()))
            .cwiseSqrt()
            .cwiseQuotient(data.full_scale);
    const bool explains = zeros.error_with_own < kExplains * spread.mean();
    zeros.own = requested == FitRequest::Zeros::per_session ||
                (requested == FitRequest::Zeros::found && found.known && explains &&
                 zeros.error_with_own < kLower * zeros.error && zeros.error - zeros.error_with_own > kWorth);
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
