// Messages on sessions that contradict each other: which, why it may be, and how to go on.
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

// Returns true if the contradiction has a certain cause, or the calibration would rather describe it than the sensor.
bool is_refused(const Contradiction& why) {
    switch (why.cause) {
        case Contradiction::Cause::exchange:
            if (why.prediction.error > why.prediction.gains) return true;
            break;
        case Contradiction::Cause::turn: return true;
        case Contradiction::Cause::factor:
            if (*remark_on(why.factor) != '\0') return true;
            break;
        case Contradiction::Cause::unknown: break;
    }
    return why.prediction.error > kRefused;
}

std::string reason(const Labelled& labelled, const Sessions& sessions, const Contradiction& why, const std::string& place,
                   std::size_t session, std::size_t other) {
    const std::string label = fmt::format("{} of {}", label_column(sessions.component[why.component]), place);
    const auto sd = [&](std::size_t s) {
        const auto& moments = sessions.moments[why.component][s];
        return moments ? std::sqrt(moments->xx(0, 0)) : kNaN;
    };
    switch (why.cause) {
        case Contradiction::Cause::factor:
            return fmt::format(
                "{} is {:.3g} times that of the others for the same readings{}. Or are its channels in another "
                "unit? The sd of {} is {:.3g} there and {:.3g} in session \"{}\".",
                label, why.factor, remark_on(why.factor), labelled.channels.front(), sd(session), sd(other),
                labelled.sessions[other]);
        case Contradiction::Cause::exchange:
            return fmt::format(
                "the channels {} and {} seem to be exchanged: with these two the other way round, the line of "
                "the others is right for {}. Correct the columns.",
                labelled.channels[why.a], labelled.channels[why.b], place);
        case Contradiction::Cause::turn:
            return fmt::format(
                "the line of the others predicts {} from another axis, or with the other sign: is the sensor "
                "mounted otherwise there, or are labels exchanged?",
                label);
        case Contradiction::Cause::unknown: break;
    }
    return fmt::format(
        "{}: a straight line of its own errs by {:.2g} % of the spread of the labels, that of the others by {:.2g} "
        "%, and no line serves both, whatever the zeros. Are channels in another unit, gain or order, or is the "
        "sensor mounted otherwise?",
        label, 100 * why.left, 100 * why.prediction.error);
}

// "1", "1 and 2", "1, 2 and 3"
std::string names(const Labelled& labelled, const std::vector<std::size_t>& sessions) {
    std::string text;
    for (std::size_t i = 0; i < sessions.size(); ++i)
        text += (i == 0 ? "" : i + 1 < sessions.size() ? ", " : " and ") + labelled.sessions[sessions[i]];
    return text;
}

}  // namespace

void check_sessions(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings) {
    if (labelled.sessions.size() < 2) return;
    std::vector<Rows> of_session(labelled.sessions.size());
    for (const auto* row : rows)
        if (row->session < of_session.size()) of_session[row->session].push_back(row);
    const Sessions sessions = sessions_of(of_session);
    const SessionVerdict verdict = contradicting(sessions);
    if (verdict.odd.empty() && !verdict.pair) return;
    const auto is_odd = [&](std::size_t s) {
        return std::find(verdict.odd.begin(), verdict.odd.end(), s) != verdict.odd.end();
    };
    std::vector<std::size_t> by;
    std::vector<std::string> rest;
    for (const std::size_t s : verdict.compared)
        if (!is_odd(s)) by.push_back(s);
    for (std::size_t s = 0; s < labelled.sessions.size(); ++s)
        if (!is_odd(s)) rest.push_back(labelled.sessions[s]);
    if (verdict.pair) by = {verdict.pair->first};
    // The worst of them is shown.
    const auto worst = std::max_element(verdict.why.begin(), verdict.why.end(), [](const auto& a, const auto& b) {
        return std::pair(is_refused(a), a.prediction.error) < std::pair(is_refused(b), b.prediction.error);
    });
    const std::size_t session = verdict.pair ? verdict.pair->second : verdict.odd[std::size_t(worst - verdict.why.begin())];
    const std::string because = reason(labelled, sessions, *worst,
                                       fmt::format("session \"{}\" (from {}:{} on)", labelled.sessions[session],
                                                   labelled.name, of_session[session].front()->line),
                                       session, by.front());
    const bool one = verdict.odd.size() == 1;
    const std::string text =
        verdict.pair ? fmt::format(
                           "sessions {0} and {1} contradict each other; the recording does not show which is wrong: {2} "
                           "Calibrate sessions that agree, for example --session {0} or --session {1}",
                           labelled.sessions[std::min(by.front(), session)],
                           labelled.sessions[std::max(by.front(), session)], because)
                     : fmt::format("session{} {} contradict{} {}: {} Calibrate without {}: --session {}", one ? "" : "s",
                                   names(labelled, verdict.odd), one ? "s" : "", names(labelled, by), because,
                                   one ? "it" : "them", fmt::join(rest, ","));
    if (is_refused(*worst)) throw Undetermined(text);
    warnings.push_back(text);
}

}  // namespace tactiled
