#include "decoupling/fit/session_lines.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/fit/recording_checks.hpp"

namespace tactiled {
namespace {

// Before the recording is known: gains of a sensor that is mounted again differ by this sd. It counts as much as ten
// sessions, which would show it to a quarter, so that errors have Student's distribution with as many degrees of freedom,
// plus one for each other session.
constexpr double kGainsDiffer = 0.03, kCountsAs = 10;
constexpr double kTiny = 1e-9;      // relative to the variance of a channel: keeps covariances definite
constexpr Eigen::Index kParts = 5;  // of the time of a session
constexpr double kLevel = 1e-3;     // probability of a contradiction in a recording without one
constexpr double kBeyond = 3;       // a load relative to the sd of those of other sessions: their line may be wrong for it
// Number of sessions whose own line may be the first consensus, and of those whose common line is enough, evenly over all.
constexpr std::size_t kCandidates = 12, kTogether = 50;

Eigen::VectorXd widths(const SessionMoments& session) { return session.xx.diagonal().cwiseSqrt(); }

// The moments of several sessions together, each with zeros of its own.
SessionMoments together(const Moments& sessions, const std::vector<std::size_t>& by) {
    SessionMoments all = *sessions[by.front()];
    for (std::size_t i = 1; i < by.size(); ++i) {
        const SessionMoments& one = *sessions[by[i]];
        all.within = std::max(all.within, one.within);
        const double share = one.rows / (all.rows + one.rows);
        all.xx += share * (one.xx - all.xx);
        all.xy += share * (one.xy - all.xy);
        all.yy += share * (one.yy - all.yy);
        all.rows += one.rows;
    }
    return all;
}

// A straight line, and the covariance of its slopes. A combination of channels that these sessions do not show may have any
// slope up to that of a single channel which carries a usual label.
struct Line {
    Eigen::VectorXd slope;
    Eigen::MatrixXd covariance;
};

Line line_of(const SessionMoments& session, double usual_variance) {
    const Eigen::VectorXd width = widths(session).cwiseMax(1e-300);
    const Eigen::MatrixXd scaled = session.xx.array() / (width * width.transpose()).array();
    const Eigen::VectorXd y = session.xy.cwiseQuotient(width);
    const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(scaled.rows(), scaled.cols());
    Line line{.slope = dense::solve_by_ldlt(scaled + kTiny * unit, y).col(0).cwiseQuotient(width), .covariance = {}};
    const double left = std::max(std::pow(error_of_line(line.slope, session, 1), 2), kTiny * session.yy);
    line.covariance =
        dense::inverse(session.rows / left * scaled + unit / usual_variance).array() / (width * width.transpose()).array();
    return line;
}

double predicted_variance(const Eigen::VectorXd& line, const SessionMoments& session) {
    return std::max(0.0, line.dot(session.xx * line));
}

// Those of `all` without `one` that have this component.
std::vector<std::size_t> others_of(const Moments& moments, const std::vector<std::size_t>& all, std::size_t one) {
    std::vector<std::size_t> others;
    std::copy_if(all.begin(), all.end(), std::back_inserter(others),
                 [&](std::size_t s) { return s != one && moments[s].has_value(); });
    return others;
}

SessionMoments moments_of(const Eigen::MatrixXd& channels, const Eigen::VectorXd& labels) {
    const auto n = double(labels.size());
    Eigen::MatrixXd x = channels;
    for (int twice = 0; twice < 2; ++twice) x.rowwise() -= Eigen::RowVectorXd(x.colwise().mean());
    const Eigen::VectorXd y = labels.array() - labels.mean();
    return {.xx = x.transpose() * x / n, .xy = x.transpose() * y / n, .yy = y.squaredNorm() / n, .rows = n};
}

double error_within(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, double variance) {
    Moments parts;
    std::vector<std::size_t> all;
    for (Eigen::Index part = 0; part < kParts; ++part) {
        const Eigen::Index begin = part * y.size() / kParts, n = (part + 1) * y.size() / kParts - begin;
        parts.emplace_back(moments_of(x.middleRows(begin, n), y.segment(begin, n)));
        all.push_back(std::size_t(part));
    }
    double squares = 0;
    for (std::size_t part = 0; part < all.size(); ++part) {
        const Line line = line_of(together(parts, others_of(parts, all, part)), variance);
        squares += std::pow(error_of_line(line.slope, *parts[part], 1), 2) / double(kParts);
    }
    return std::sqrt(squares);
}

// Returns nothing where the rows are too few to show a contradiction, or where label or channels are constant.
std::optional<SessionMoments> moments_of(const Rows& rows, std::size_t component) {
    const Rows known = rows_with(rows, {component});
    if (known.size() < kFewestRows || known.size() < 3 * (known.front()->channel.size() + 1)) return std::nullopt;
    const Eigen::MatrixXd x = channels_of(known);
    const Eigen::VectorXd y = labels_of(known, {component});
    SessionMoments moments = moments_of(x, y);
    if (!(moments.xx.diagonal().minCoeff() > 0) || !(moments.yy > 0)) return std::nullopt;
    moments.within = error_within(x, y, moments.yy);
    return moments;
}

double usual_variance(const Moments& sessions) {
    std::vector<double> all;
    for (const auto& session : sessions)
        if (session) all.push_back(session->yy);
    return median(std::move(all));
}

double spread_of(const Moments& sessions, const Eigen::VectorXd& line, const SessionMoments& session) {
    return std::sqrt(std::max({session.yy, predicted_variance(line, session), usual_variance(sessions)}));
}

// Returns the limit of the error of Student's distribution for so many comparisons in a recording.
double student_limit(double degrees, std::size_t comparisons) {
    return boost::math::quantile(
        boost::math::complement(boost::math::students_t(degrees), kLevel / 2 / double(comparisons)));
}

// Returns true if a session has no load that is far beyond those of the others, in any combination of the axes: their line
// may be wrong for such a load. Each label as it stands or as the others' line predicts it, whichever is smaller, because
// its unit or that of the channels may be another one.
bool are_loaded_alike(const Sessions& sessions, const std::vector<std::size_t>& by, std::size_t session) {
    Eigen::VectorXd unit = Eigen::VectorXd::Ones(sessions.loads[session].cols());
    for (Eigen::Index c = 0; c < unit.size(); ++c) {
        const Moments& moments = sessions.moments[std::size_t(c)];
        const std::vector<std::size_t> others = others_of(moments, by, session);
        if (others.empty() || !moments[session]) continue;
        const Line line = line_of(together(moments, others), usual_variance(moments));
        unit[c] = std::min(1.0, std::sqrt(predicted_variance(line.slope, *moments[session]) / moments[session]->yy));
    }
    const Eigen::MatrixXd loads = unit.asDiagonal() * sessions.loads[session] * unit.asDiagonal();
    Eigen::MatrixXd known = Eigen::MatrixXd::Zero(loads.rows(), loads.cols());
    double rows = 0;
    for (const std::size_t other : by) {
        known += sessions.rows[other] * sessions.loads[other];
        rows += sessions.rows[other];
    }
    known /= rows;
    known.diagonal() += kTiny * loads.diagonal();
    for (Eigen::Index c = 0; c < known.rows(); ++c)
        if (!(known(c, c) > 0)) known(c, c) = 1;  // neither has this load
    const Eigen::MatrixXd root = dense::lower_factor(known);
    const Eigen::MatrixXd half = dense::solve_lower(root, loads);
    return dense::symmetric_eigen(dense::solve_lower(root, half.transpose())).values.maxCoeff() < kBeyond * kBeyond;
}

// Returns true if the line of the sessions `by` is wrong for a component of this one.
bool contradicts(const Sessions& sessions, const std::vector<std::size_t>& by, std::size_t session,
                 std::size_t comparisons) {
    std::vector<std::size_t> few;
    for (std::size_t i = 0; i < by.size(); i += 1 + (by.size() - 1) / kTogether)
        if (by[i] != session) few.push_back(by[i]);
    if (few.empty() || !are_loaded_alike(sessions, few, session)) return false;
    return std::any_of(sessions.moments.begin(), sessions.moments.end(), [&](const Moments& moments) {
        const std::vector<std::size_t> others = others_of(moments, few, session);
        if (!moments[session] || others.empty()) return false;
        const Prediction found = predict(moments, others, session, comparisons);
        return found.error > found.limit;
    });
}

// The sessions that agree in all components with the session with which most agree.
std::vector<std::size_t> consensus(const Sessions& sessions, const std::vector<std::size_t>& compared,
                                   std::size_t comparisons) {
    std::vector<std::size_t> best;
    const std::size_t every = 1 + (compared.size() - 1) / kCandidates;
    for (std::size_t i = 0; i < compared.size(); i += every) {
        std::vector<std::size_t> agree;
        for (const std::size_t s : compared)
            if (s == compared[i] || !contradicts(sessions, {compared[i]}, s, comparisons)) agree.push_back(s);
        if (agree.size() > best.size()) best = std::move(agree);
    }
    return best;
}

}  // namespace

double error_of_line(const Eigen::VectorXd& line, const SessionMoments& session, double spread) {
    return std::sqrt(std::max(0.0, session.yy + predicted_variance(line, session) - 2 * line.dot(session.xy))) / spread;
}

Prediction predict(const Moments& sessions, const std::vector<std::size_t>& by, std::size_t of, std::size_t comparisons) {
    const SessionMoments &session = *sessions[of], known = together(sessions, by);
    const double usual = usual_variance(sessions);
    const Line others = line_of(known, usual);
    Prediction result{.line = others.slope, .spread = spread_of(sessions, others.slope, session)};
    result.error = error_of_line(others.slope, session, result.spread);
    result.alone = session.within / result.spread;
    // What gains that differ, a sensor that is not straight, and loads that the others do not have may do.
    const double gains = kGainsDiffer * others.slope.cwiseProduct(widths(session)).norm() / result.spread;
    const double bent = std::max(session.within, known.within) / result.spread;
    const double unknown = std::sqrt(std::max(0.0, others.covariance.cwiseProduct(session.xx).sum())) / result.spread;
    const double before = gains * gains + bent * bent;
    double squares = kCountsAs * before;
    for (const std::size_t other : by)
        squares += std::min(before, std::pow(error_of_line(others.slope, *sessions[other], result.spread), 2));
    result.limit = student_limit(kCountsAs + double(by.size() - 1), comparisons) *
                   std::sqrt(squares / (kCountsAs + double(by.size())) + unknown * unknown);
    return result;
}

Sessions sessions_of(const std::vector<Rows>& of_session) {
    Sessions sessions;
    for (std::size_t c = 0; c < 6; ++c) {
        Moments moments;
        for (const Rows& rows : of_session) moments.push_back(rows.empty() ? std::nullopt : moments_of(rows, c));
        if (std::none_of(moments.begin(), moments.end(), [](const auto& one) { return one.has_value(); })) continue;
        sessions.component.push_back(c);
        sessions.moments.push_back(std::move(moments));
    }
    const auto m = Eigen::Index(sessions.component.size());
    for (std::size_t s = 0; s < of_session.size(); ++s) {
        Eigen::MatrixXd& loads = sessions.loads.emplace_back(Eigen::MatrixXd::Zero(m, m));
        sessions.rows.push_back(double(of_session[s].size()));
        std::vector<Eigen::Index> present;
        std::vector<std::size_t> components;
        for (Eigen::Index c = 0; c < m; ++c)
            if (sessions.moments[std::size_t(c)][s]) {
                present.push_back(c);
                components.push_back(sessions.component[std::size_t(c)]);
                loads(c, c) = sessions.moments[std::size_t(c)][s]->yy;
            }
        const Rows whole = rows_with(of_session[s], components);
        if (whole.size() < kFewestRows) continue;
        Eigen::MatrixXd y = labels_of(whole, components);
        y.rowwise() -= Eigen::RowVectorXd(y.colwise().mean());
        loads(present, present) = y.transpose() * y / double(whole.size());
    }
    return sessions;
}

SessionVerdict contradicting(const Sessions& sessions) {
    SessionVerdict verdict;
    for (std::size_t s = 0; s < sessions.loads.size(); ++s)
        if (std::any_of(sessions.moments.begin(), sessions.moments.end(),
                        [&](const Moments& each) { return each[s].has_value(); }))
            verdict.compared.push_back(s);
    if (verdict.compared.size() < 2) return verdict;
    const std::size_t comparisons = verdict.compared.size() * sessions.moments.size();
    const std::vector<std::size_t> agree = consensus(sessions, verdict.compared, comparisons);
    for (const std::size_t s : verdict.compared)
        if (contradicts(sessions, agree, s, comparisons)) verdict.odd.push_back(s);
    if (2 * verdict.odd.size() < verdict.compared.size()) return verdict;
    // Of two sessions, or without a majority, none is named alone.
    const std::size_t odd = verdict.odd.front();
    const auto other = std::find_if(agree.begin(), agree.end(), [&](std::size_t s) { return s != odd; });
    verdict.odd.clear();
    verdict.pair = std::minmax(odd, *other);
    return verdict;
}

}  // namespace tactiled
