// What the user reads of sessions that contradict each other: which, why it may be, and how to go on.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/recording_checks.hpp"
#include "decoupling/fit/session_lines.hpp"

namespace tactiled {
namespace {

constexpr double kNearUnit = 0.05;
struct Unit {
    double factor;
    const char* remark;
};
constexpr Unit kUnits[] = {{-1, ": the sign is the other one; a press has fz < 0"},
                           {101.97, ": 1 N is the weight of 102 g"},
                           {0.10197, ": 1 N is the weight of 0.102 kg"},
                           {1000, ": 1 N is 1000 mN"},
                           {0.22481, ": 1 N is 0.225 lbf"}};
// Half of the spread: the calibration would rather describe the contradiction than the sensor. Less is a warning.
constexpr double kRefused = 0.5;

const char* remark_on(double factor) {
    for (const Unit& unit : kUnits)
        for (const double ratio : {factor, 1 / factor})
            if (std::abs(ratio / unit.factor - 1) < kNearUnit) return unit.remark;
    return "";
}

// One session and those whose line contradicts it.
struct Case {
    const Labelled& labelled;
    const Sessions& sessions;
    std::vector<std::size_t> by;
    std::size_t session;
    std::vector<std::optional<Prediction>> predictions;  // of each component
    std::size_t worst;                                   // the component farthest beyond its limit
};

Case case_of(const Labelled& labelled, const Sessions& sessions, const std::vector<std::size_t>& by, std::size_t session,
             std::size_t comparisons) {
    Case result{labelled, sessions, by, session, {}, 0};
    double most = 0;
    for (std::size_t c = 0; c < sessions.moments.size(); ++c) {
        std::vector<std::size_t> present;
        for (const std::size_t s : by)
            if (sessions.moments[c][s]) present.push_back(s);
        auto& one = result.predictions.emplace_back();
        if (present.empty() || !sessions.moments[c][session]) continue;
        one = predict(sessions.moments[c], present, session, comparisons);
        if (const double times = one->error / one->limit; times > most) most = times, result.worst = c;
    }
    return result;
}

double width(const Case& of, std::size_t session) { return std::sqrt(of.sessions.moments[of.worst][session]->xx(0, 0)); }

// A correction of the session with which the others' line is right.
struct Correction {
    std::string text;
    double error = 0;  // with it, of the worst component
};

Correction as_factor(const Case& of) {
    const Prediction& found = *of.predictions[of.worst];
    const SessionMoments& session = *of.sessions.moments[of.worst][of.session];
    const double factor = found.line.dot(session.xy) / found.line.dot(session.xx * found.line);
    return {fmt::format(
                "{} of {} is {:.3g} times that of the others for the same readings{}. Or are its channels in another "
                "unit? The sd of {} is {:.3g} there and {:.3g} in session \"{}\".",
                label_column(of.sessions.component[of.worst]), "{}", factor, remark_on(factor), of.labelled.channels.front(),
                width(of, of.session), width(of, of.by.front()), of.labelled.sessions[of.by.front()]),
            error_of_line(factor * found.line, session, std::max(found.spread, std::abs(factor) * found.spread))};
}

Correction as_exchange(const Case& of) {
    const std::size_t n = of.labelled.channels.size();
    Correction best{"", std::numeric_limits<double>::infinity()};
    for (std::size_t j = 0; j < n; ++j)
        for (std::size_t k = j + 1; k < n; ++k) {
            double error = 0;  // of the component that is worst with the exchange
            for (std::size_t c = 0; c < of.sessions.moments.size(); ++c) {
                if (!of.predictions[c]) continue;
                Eigen::VectorXd line = of.predictions[c]->line;
                std::swap(line[Eigen::Index(j)], line[Eigen::Index(k)]);
                error = std::max(error, error_of_line(line, *of.sessions.moments[c][of.session], of.predictions[c]->spread));
            }
            if (error < best.error)
                best = {
                    fmt::format("the channels {} and {} seem to be exchanged: with these two the other way round, the line "
                                "of the others is right for {}. Correct the columns.",
                                of.labelled.channels[j], of.labelled.channels[k], "{}"),
                    error};
        }
    return best;
}

// The labels of the session are a mixture of what the others predict for all axes.
Correction as_turn(const Case& of) {
    const SessionMoments& session = *of.sessions.moments[of.worst][of.session];
    Eigen::MatrixXd lines(session.xx.cols(), 0);
    for (const auto& each : of.predictions) {
        if (!each) continue;
        lines.conservativeResize(Eigen::NoChange, lines.cols() + 1);
        lines.rightCols(1) = each->line;
    }
    if (lines.cols() < 2) return {"", std::numeric_limits<double>::infinity()};
    const Eigen::MatrixXd gram = lines.transpose() * session.xx * lines;
    const Eigen::VectorXd part = dense::least_norm_of_one(gram, lines.transpose() * session.xy);
    return {fmt::format("the line of the others predicts {} of {} from another axis, or with the other sign: is the sensor "
                        "mounted otherwise there, or are labels exchanged?",
                        label_column(of.sessions.component[of.worst]), "{}"),
            error_of_line(lines * part, session, of.predictions[of.worst]->spread)};
}

struct Explained {
    std::string text;
    bool is_explained;
};

// Returns the correction with the smallest error, if it explains the session.
Explained explain(const Case& of, const std::string& place) {
    const Prediction& found = *of.predictions[of.worst];
    Correction best = as_factor(of);
    if (Correction other = as_exchange(of); other.error < best.error) best = std::move(other);
    if (!(best.error <= found.limit)) best = as_turn(of);  // which has more freedom
    if (best.error <= found.limit) return {fmt::format(fmt::runtime(best.text), place), true};
    const double percent = 100 * found.spread;
    return {
        fmt::format("{} of {}: the straight line of the others errs by {:.2g} % of the spread of the labels, one of its "
                    "own, in parts that it has not seen, by "
                    "{:.2g} %, whatever the zeros. Are channels in another unit, gain or order, or is the sensor mounted "
                    "otherwise?",
                    label_column(of.sessions.component[of.worst]), place, percent / found.spread * found.error,
                    percent / found.spread * found.alone),
        false};
}

// "1", "1 and 2", "1, 2 and 3"
std::string names(const Labelled& labelled, const std::vector<std::size_t>& sessions) {
    std::string text;
    for (std::size_t i = 0; i < sessions.size(); ++i)
        text += (i == 0 ? "" : i + 1 < sessions.size() ? ", " : " and ") + labelled.sessions[sessions[i]];
    return text;
}

void say(const Case& of, const SessionVerdict& verdict, const Rows& first_rows, std::vector<std::string>& warnings) {
    const Labelled& labelled = of.labelled;
    const std::string place = fmt::format("session \"{}\" (from {}:{} on)", labelled.sessions[of.session], labelled.name,
                                          first_rows[of.session]->line);
    const Explained why = explain(of, place);
    std::vector<std::string> rest;
    for (std::size_t s = 0; s < labelled.sessions.size(); ++s)
        if (std::find(verdict.odd.begin(), verdict.odd.end(), s) == verdict.odd.end()) rest.push_back(labelled.sessions[s]);
    const bool one = verdict.odd.size() == 1;
    const std::string text =
        verdict.pair
            ? fmt::format(
                  "sessions {} and {} contradict each other; the recording does not show which is wrong: {} Calibrate "
                  "sessions that agree, for example --session {} or --session {}",
                  labelled.sessions[verdict.pair->first], labelled.sessions[verdict.pair->second], why.text,
                  labelled.sessions[verdict.pair->first], labelled.sessions[verdict.pair->second])
            : fmt::format("session{} {} contradict{} {}: {} Calibrate without {}: --session {}", one ? "" : "s",
                          names(labelled, verdict.odd), one ? "s" : "", names(labelled, of.by), why.text,
                          one ? "it" : "them", fmt::join(rest, ","));
    if (why.is_explained || of.predictions[of.worst]->error > kRefused) throw Undetermined(text);
    warnings.push_back(text);
}

}  // namespace

void check_sessions(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings) {
    if (labelled.sessions.size() < 2) return;
    std::vector<Rows> of_session(labelled.sessions.size());
    for (const auto* row : rows)
        if (row->session < of_session.size()) of_session[row->session].push_back(row);
    Rows first;
    for (const Rows& each : of_session) first.push_back(each.empty() ? rows.front() : each.front());
    const Sessions sessions = sessions_of(of_session);
    const SessionVerdict verdict = contradicting(sessions);
    if (verdict.odd.empty() && !verdict.pair) return;
    std::vector<std::size_t> by;
    for (const std::size_t s : verdict.compared)
        if (std::find(verdict.odd.begin(), verdict.odd.end(), s) == verdict.odd.end()) by.push_back(s);
    const std::size_t session = verdict.pair ? verdict.pair->second : verdict.odd.front();
    if (verdict.pair) by = {verdict.pair->first};
    say(case_of(labelled, sessions, by, session, verdict.compared.size() * sessions.moments.size()), verdict, first,
        warnings);
}

}  // namespace tactiled
