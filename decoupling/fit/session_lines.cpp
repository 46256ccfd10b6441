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
constexpr double kTiny = 1e-9;                    // relative to the variance of a channel: keeps covariances definite
constexpr Eigen::Index kParts = 5;                // parts of the time of a session
constexpr double kLevel = 1e-3;                   // probability of a contradiction in a recording without one
constexpr double kLower = 0.67, kExplains = 0.5;  // errors with a correction over those without, and over the spread
// An exchange is all or nothing: three sd of what other gains do are enough for it.
constexpr double kClear = 3;
constexpr double kBeyond = 3;  // a load relative to the sd of those of other sessions: their line may be wrong for it
// Number of sessions whose own line may be the first consensus, and of those whose common line is enough, evenly over all.
constexpr std::size_t kCandidates = 12, kTogether = 50;

Eigen::VectorXd widths(const SessionMoments& session) { return session.xx.diagonal().cwiseSqrt(); }

// The moments of several sessions together, each with zeros of its own.
SessionMoments together(const Moments& sessions, const std::vector<std::size_t>& by) {
    SessionMoments all = *sessions[by.front()];
    for (std::size_t i = 1; i < by.size(); ++i) {
        const SessionMoments& one = *sessions[by[i]];
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

Line line_of(const SessionMoments& session, double usual_variance, double ridge = kTiny) {
    const Eigen::VectorXd width = widths(session).cwiseMax(1e-300);
    const Eigen::MatrixXd scaled = session.xx.array() / (width * width.transpose()).array();
    const Eigen::VectorXd y = session.xy.cwiseQuotient(width);
    const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(scaled.rows(), scaled.cols());
    Line line{.slope = dense::solve_by_ldlt(scaled + ridge * unit, y).col(0).cwiseQuotient(width), .covariance = {}};
    const double left = std::max(std::pow(error_of_line(line.slope, session, 1), 2), kTiny * session.yy);
    line.covariance =
        dense::inverse(session.rows / left * scaled + unit / usual_variance).array() / (width * width.transpose()).array();
    return line;
}

double predicted_variance(const Eigen::VectorXd& line, const SessionMoments& session) {
    return std::max(0.0, line.dot(session.xx * line));
}

// Returns the sessions of `all` without `one` that have this component.
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
    return {.xx = x.transpose() * x / n, .xy = x.transpose() * y / n, .yy = y.squaredNorm() / n, .rows = n, .parts = {}};
}

// Returns nothing where the rows are too few to show a contradiction, or where label or channels are constant.
std::optional<SessionMoments> moments_of(const Rows& rows, std::size_t component) {
    const Rows known = rows_with(rows, {component});
    if (known.size() < kFewestRows || known.size() < 3 * (known.front()->channel.size() + 1)) return std::nullopt;
    const Eigen::MatrixXd x = channels_of(known);
    const Eigen::VectorXd y = labels_of(known, {component});
    SessionMoments moments = moments_of(x, y);
    if (!(moments.xx.diagonal().minCoeff() > 0) || !(moments.yy > 0)) return std::nullopt;
    for (Eigen::Index part = 0; part < kParts; ++part) {
        const Eigen::Index begin = part * y.size() / kParts, rows_of_part = (part + 1) * y.size() / kParts - begin;
        moments.parts.push_back(moments_of(x.middleRows(begin, rows_of_part), y.segment(begin, rows_of_part)));
    }
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
        const SessionMoments together_here = together(moments, others);
        const Line line = line_of(together_here, usual_variance(moments));
        // A line that does not explain the others' own labels, because these are noise, predicts none.
        if (error_of_line(line.slope, together_here, std::sqrt(together_here.yy)) < kExplains)
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

// Returns the line with the smallest error in a session and in others, each relative to the spread of its labels, so that a
// session in another unit does not outweigh the rest.
Eigen::VectorXd common_line(const Moments& sessions, const std::vector<std::size_t>& by, std::size_t of, double usual) {
    Moments relative{sessions[of], together(sessions, by)};
    for (auto& each : relative) {
        const double variance = std::max(each->yy, usual);
        each->xx /= variance, each->xy /= variance, each->yy /= variance;
        each->rows = 1;
    }
    return line_of(together(relative, {0, 1}), 1).slope;
}

Prediction predict(const Moments& sessions, const std::vector<std::size_t>& by, std::size_t of, double degrees,
                   std::size_t comparisons) {
    const SessionMoments& session = *sessions[of];
    const double usual = usual_variance(sessions);
    // Gains that differ between sessions act like noise of the channels: the line must not depend on small differences of
    // them.
    const Line others = line_of(together(sessions, by), usual, kGainsDiffer * kGainsDiffer);
    Prediction result{.line = others.slope,
                      .own = line_of(session, usual).slope,
                      .common = common_line(sessions, by, of, usual),
                      .spread = spread_of(sessions, others.slope, session)};
    result.error = error_of_line(others.slope, session, result.spread);
    const double gains = kGainsDiffer * others.slope.cwiseProduct(widths(session)).norm() / result.spread;
    const double unknown = std::sqrt(std::max(0.0, others.covariance.cwiseProduct(session.xx).sum())) / result.spread;
    const double times = student_limit(degrees, comparisons);
    result.sd = gains;
    result.gains = times * gains;
    result.limit = times * std::hypot(gains, unknown);
    return result;
}

// Returns true if `line` lowers the error of `before` by a third in each part of the session that has such a load, and
// explains half of its labels.
bool explains(const Eigen::VectorXd& before, const Eigen::VectorXd& line, const SessionMoments& session) {
    return std::all_of(session.parts.begin(), session.parts.end(), [&](const SessionMoments& part) {
        const double spread = std::sqrt(part.yy), left = error_of_line(line, part, 1);
        return kBeyond * spread < std::sqrt(session.yy) ||
               (left < kLower * error_of_line(before, part, 1) && left < kExplains * spread);
    });
}

// The predictions of all components that a session and the others have.
struct Predictions {
    std::vector<std::size_t> component;
    std::vector<const SessionMoments*> session;
    std::vector<Prediction> of;
};

Predictions predictions_of(const Sessions& sessions, const std::vector<std::size_t>& by, std::size_t session) {
    Predictions predictions;
    for (std::size_t c = 0; c < sessions.moments.size(); ++c) {
        const Moments& moments = sessions.moments[c];
        const std::vector<std::size_t> others = others_of(moments, by, session);
        if (!moments[session] || others.empty()) continue;
        predictions.component.push_back(c);
        predictions.session.push_back(&*moments[session]);
        predictions.of.push_back(predict(moments, others, session, kCountsAs + double(others.size() - 1),
                                         sessions.rows.size() * sessions.moments.size()));
    }
    return predictions;
}

std::optional<Contradiction> as_factor(const Predictions& predictions) {
    for (std::size_t i = 0; i < predictions.of.size(); ++i) {
        const SessionMoments& session = *predictions.session[i];
        const Prediction& found = predictions.of[i];
        const double factor = found.line.dot(session.xy) / predicted_variance(found.line, session);
        if (found.error > found.limit && explains(found.line, factor * found.line, session))
            return Contradiction{.cause = Contradiction::Cause::factor,
                                 .component = predictions.component[i],
                                 .prediction = found,
                                 .factor = factor,
                                 .left = error_of_line(factor * found.line, session, std::sqrt(session.yy))};
    }
    return std::nullopt;
}

Eigen::VectorXd exchanged(Eigen::VectorXd line, std::pair<Eigen::Index, Eigen::Index> channels) {
    std::swap(line[channels.first], line[channels.second]);
    return line;
}

// The two channels whose exchange lowers the errors most, relative to their spreads.
std::pair<Eigen::Index, Eigen::Index> best_exchange(const Predictions& predictions) {
    const Eigen::Index n = predictions.of.front().line.size();
    std::pair<Eigen::Index, Eigen::Index> best;
    double min = std::numeric_limits<double>::infinity();
    for (Eigen::Index j = 0; j < n; ++j)
        for (Eigen::Index k = j + 1; k < n; ++k) {
            double sum = 0;
            for (std::size_t i = 0; i < predictions.of.size(); ++i)
                sum += error_of_line(exchanged(predictions.of[i].line, {j, k}), *predictions.session[i],
                                     predictions.of[i].spread);
            if (sum < min) min = sum, best = {j, k};
        }
    return best;
}

std::optional<Contradiction> as_exchange(const Predictions& predictions) {
    const auto best = best_exchange(predictions);
    for (std::size_t i = 0; i < predictions.of.size(); ++i) {
        const Prediction& found = predictions.of[i];
        const SessionMoments& session = *predictions.session[i];
        const Eigen::VectorXd line = exchanged(found.line, best);
        if (found.error > kClear * found.sd && explains(found.line, line, session))
            return Contradiction{.cause = Contradiction::Cause::exchange,
                                 .component = predictions.component[i],
                                 .prediction = found,
                                 .a = std::size_t(best.first),
                                 .b = std::size_t(best.second),
                                 .left = error_of_line(line, session, std::sqrt(session.yy))};
    }
    return std::nullopt;
}

// The labels of a component are a mixture of what the others predict for all axes.
std::optional<Contradiction> as_turn(const Predictions& predictions) {
    if (predictions.of.size() < 2) return std::nullopt;
    Eigen::MatrixXd lines(predictions.of.front().line.size(), Eigen::Index(predictions.of.size()));
    for (std::size_t i = 0; i < predictions.of.size(); ++i) lines.col(Eigen::Index(i)) = predictions.of[i].line;
    for (std::size_t i = 0; i < predictions.of.size(); ++i) {
        const SessionMoments& session = *predictions.session[i];
        const Prediction& found = predictions.of[i];
        const Eigen::VectorXd mixed =
            lines * dense::least_norm_of_one(lines.transpose() * session.xx * lines, lines.transpose() * session.xy);
        if (found.error > found.limit && explains(found.line, mixed, session))
            return Contradiction{
                .cause = Contradiction::Cause::turn, .component = predictions.component[i], .prediction = found};
    }
    return std::nullopt;
}

// A line of its own: the cause is not known.
std::optional<Contradiction> as_other_sensor(const Predictions& predictions) {
    for (std::size_t i = 0; i < predictions.of.size(); ++i) {
        const Prediction& found = predictions.of[i];
        const SessionMoments& session = *predictions.session[i];
        const double common = error_of_line(found.common, session, found.spread);
        if (common > found.limit && explains(found.common, found.own, session))
            return Contradiction{.component = predictions.component[i],
                                 .prediction = found,
                                 .left = error_of_line(found.own, session, std::sqrt(session.yy))};
    }
    return std::nullopt;
}

}  // namespace

double error_of_line(const Eigen::VectorXd& line, const SessionMoments& session, double spread) {
    return std::sqrt(std::max(0.0, session.yy + predicted_variance(line, session) - 2 * line.dot(session.xy))) / spread;
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

// The sessions that agree in all components with the session with which most agree.
std::vector<std::size_t> consensus(const Sessions& sessions, const std::vector<std::size_t>& compared) {
    std::vector<std::size_t> best;
    const std::size_t every = 1 + (compared.size() - 1) / kCandidates;
    for (std::size_t i = 0; i < compared.size(); i += every) {
        std::vector<std::size_t> agree;
        for (const std::size_t s : compared)
            if (s == compared[i] || !contradiction(sessions, {compared[i]}, s)) agree.push_back(s);
        if (agree.size() > best.size()) best = std::move(agree);
    }
    return best;
}

std::optional<Contradiction> contradiction(const Sessions& sessions, const std::vector<std::size_t>& by,
                                           std::size_t session) {
    std::vector<std::size_t> few;
    for (std::size_t i = 0; i < by.size(); i += 1 + (by.size() - 1) / kTogether)
        if (by[i] != session) few.push_back(by[i]);
    if (few.empty() || !are_loaded_alike(sessions, few, session)) return std::nullopt;
    // Both ways: what corrects the session against the others corrects one of them against it.
    const Predictions there = predictions_of(sessions, few, session),
                      back = predictions_of(sessions, {session}, few.front());
    if (there.of.empty() || back.of.empty()) return std::nullopt;
    const auto both_ways = [&](const auto& cause) {
        std::optional<Contradiction> found = cause(there);
        if (found && !cause(back)) found.reset();
        return found;
    };
    std::optional<Contradiction> best = both_ways(as_factor), exchange = as_exchange(there);
    if (exchange && best_exchange(back) == std::pair(Eigen::Index(exchange->a), Eigen::Index(exchange->b)) &&
        (!best || exchange->left < best->left))
        best = exchange;
    if (!best) best = both_ways(as_turn);  // a turn has more freedom
    return best ? best : both_ways(as_other_sensor);
}

SessionVerdict contradicting(const Sessions& sessions) {
    SessionVerdict verdict;
    for (std::size_t s = 0; s < sessions.loads.size(); ++s)
        if (std::any_of(sessions.moments.begin(), sessions.moments.end(),
                        [&](const Moments& each) { return each[s].has_value(); }))
            verdict.compared.push_back(s);
    if (verdict.compared.size() < 2) return verdict;
    const std::vector<std::size_t> agree = consensus(sessions, verdict.compared);
    for (const std::size_t s : verdict.compared)
        if (auto why = contradiction(sessions, agree, s)) {
            verdict.odd.push_back(s);
            verdict.why.push_back(std::move(*why));
        }
    if (2 * verdict.odd.size() < verdict.compared.size()) return verdict;
    // Neither of two sessions is named alone, and none without a majority.
    const std::size_t odd = verdict.odd.front();
    const auto other = std::find_if(agree.begin(), agree.end(), [&](std::size_t s) { return s != odd; });
    verdict.odd.clear();
    verdict.pair = {*other, odd};
    verdict.why.resize(1);
    return verdict;
}

}  // namespace tactiled
