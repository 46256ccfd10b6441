#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/fit/recording_checks.hpp"
#include "decoupling/fit/session_pairs.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kNearUnit = 0.05, kCorrelated = 0.98;
struct Unit {
    double factor;
    const char* remark;
};
constexpr Unit kUnits[] = {{-1, "the sign is the other one; a press has fz < 0"},
                           {101.97, "1 N is the weight of 102 g"},
                           {0.10197, "1 N is the weight of 0.102 kg"},
                           {1000, "1 N is 1000 mN"},
                           {0.22481, "1 N is 0.225 lbf"}};
// Errors of straight lines, relative to the labels' spread. kAlone: maximum for one session. kContradicts, kRefused: errors
// of one line through two sessions from which they contradict each other, and are refused. kTimesAlone: minimum ratio to the
// errors of a line each.
constexpr double kAlone = 0.5, kContradicts = 0.3, kRefused = 0.5, kTimesAlone = 2;

struct Data {
    Eigen::MatrixXd x;
    Eigen::VectorXd y;
};

Data data_of(const Rows& rows, std::size_t c) {
    const Rows known = rows_with(rows, {c});
    if (known.empty()) return {Eigen::MatrixXd(0, Eigen::Index(rows.front()->channel.size())), {}};
    return {channels_of(known), labels_of(known, {c})};
}

double width(const Data& data) { return data.x.col(0).maxCoeff() - data.x.col(0).minCoeff(); }

// "session \"1\" (from a.csv:2 on)"
std::string place(const Labelled& labelled, const std::vector<Rows>& of_session, std::size_t s) {
    return fmt::format("session \"{}\" (from {}:{} on)", labelled.sessions[s], labelled.name, of_session[s].front()->line);
}

struct Factor {
    double factor;
    const Unit* unit;  // nullptr: none that is known
};

// Returns the factor between the labels of session `there` and those that the straight line of `here` gives for its
// readings; nullopt if the line does not predict them up to a factor.
std::optional<Factor> factor_between(const Rows& here, const Rows& there, std::size_t c) {
    if (here.size() < kFewestRows || there.size() < kFewestRows) return std::nullopt;
    const Data before = data_of(here, c), after = data_of(there, c);
    if (before.x.rows() < 3 * (before.x.cols() + 1) || after.x.rows() < Eigen::Index(kFewestRows)) return std::nullopt;
    const Affine affine = affine_fit(before.x, before.y);
    if (!affine.slope.dependent.empty()) return std::nullopt;
    const Eigen::VectorXd says = after.x * affine.slope.coefficient;
    const Eigen::ArrayXd a = says.array() - says.mean(), b = after.y.array() - after.y.mean();
    const double factor = (a * b).sum() / a.square().sum();
    const double correlation = (a * b).sum() / std::sqrt(a.square().sum() * b.square().sum());
    if (!(std::abs(correlation) > kCorrelated)) return std::nullopt;
    for (const Unit& unit : kUnits)
        for (const double ratio : {factor, 1 / factor})
            if (std::abs(ratio / unit.factor - 1) < kNearUnit) return Factor{factor, &unit};
    return Factor{factor, nullptr};
}

void refuse_or_warn(const Contradictions& found, const std::string& text, std::vector<std::string>& warnings) {
    if (!found.doubtful) throw Undetermined(text);
    warnings.push_back(text);
}

// Finds sessions whose labels have another unit or another sign than the others: the straight line of one session predicts
// the other session except for this factor.
void check_units(const Labelled& labelled, const std::vector<Rows>& of_session, std::vector<std::string>& warnings) {
    for (std::size_t c = 0; c < 6; ++c) {
        const auto either = [&](std::size_t a, std::size_t b) {
            const auto there = factor_between(of_session[a], of_session[b], c);
            return there ? there : factor_between(of_session[b], of_session[a], c);
        };
        const Contradictions found =
            contradictions(of_session.size(), [&](std::size_t a, std::size_t b) -> std::optional<bool> {
                const auto factor = either(a, b);
                if (!factor) return std::nullopt;
                return factor->unit != nullptr;
            });
        if (found.pairs.empty()) continue;
        const auto [reference, other] = found.shown;
        auto factor = factor_between(of_session[reference], of_session[other], c);
        if (!factor) {
            factor = factor_between(of_session[other], of_session[reference], c);
            factor->factor = 1 / factor->factor;
        }
        refuse_or_warn(found,
                       fmt::format("{}: {} of {} is {:.3g} times that of session \"{}\" for the same readings{}{}. Or are "
                                   "its channels in another "
                                   "unit? {} extends over {:.3g} there and over {:.3g} in session \"{}\". {}",
                                   verdict(labelled, found), label_column(c), place(labelled, of_session, other),
                                   factor->factor, labelled.sessions[reference], factor->unit != nullptr ? ": " : "",
                                   factor->unit != nullptr ? factor->unit->remark : "", labelled.channels.front(),
                                   width(data_of(of_session[other], c)), width(data_of(of_session[reference], c)),
                                   labelled.sessions[reference], advice(labelled, found)),
                       warnings);
    }
}

// Finds sessions with a rotated sensor or with two exchanged channels. Spare channels, and gains that differ between the
// sessions, hide both from a straight line through two sessions, but not from the line of one session.
void check_orders(const Labelled& labelled, const std::vector<Rows>& of_session, const std::vector<std::size_t>& components,
                  std::vector<std::string>& warnings) {
    std::vector<std::optional<SessionMoments>> moments;
    for (const Rows& rows : of_session) moments.push_back(moments_of(rows, components));
    const Contradictions found = contradictions(of_session.size(), [&](std::size_t a, std::size_t b) -> std::optional<bool> {
        if (!moments[a] || !moments[b]) return std::nullopt;
        return disagreement(*moments[a], *moments[b]).has_value();
    });
    if (found.pairs.empty()) return;
    const auto [reference, other] = found.shown;
    const Disagreement why = *disagreement(*moments[reference], *moments[other]);
    const std::string text =
        why.exchanged
            ? fmt::format(
                  "the channels {} and {} seem to be exchanged: the readings of {} agree far better with those "
                  "of session \"{}\" if they are exchanged back. Correct the columns",
                  labelled.channels[why.a], labelled.channels[why.b], place(labelled, of_session, other),
                  labelled.sessions[reference])
            : fmt::format(
                  "a straight line through session \"{}\" predicts {} of {} not at all, or with the other "
                  "sign, but a line through that session itself does. Is the sensor mounted otherwise there, "
                  "or are labels or channels exchanged?",
                  labelled.sessions[reference], label_column(components[why.a]), place(labelled, of_session, other));
    refuse_or_warn(
        found, fmt::format("{}: {}{} {}", verdict(labelled, found), text, why.exchanged ? "." : "", advice(labelled, found)),
        warnings);
}

// The straight line through the readings of one session and its error.
struct Line {
    Data data;  // minus their means
    double rms = 0;
};

double rms_of(const Eigen::VectorXd& values) { return std::sqrt(values.squaredNorm() / double(values.size())); }

std::optional<double> rms_of_line(const Data& centred) {
    const Affine affine = affine_fit(centred.x, centred.y);
    if (!affine.slope.dependent.empty()) return std::nullopt;
    return rms_of(centred.y - centred.x * affine.slope.coefficient);
}

// Returns nothing where the rows are too few, or the channels do not determine the label.
std::optional<Line> line_of(const Rows& rows, std::size_t c) {
    if (rows.size() < kFewestRows) return std::nullopt;
    Line line{.data = data_of(rows, c)};
    Data& data = line.data;
    if (data.x.rows() < std::max<Eigen::Index>(kFewestRows, 3 * (data.x.cols() + 1))) return std::nullopt;
    data.x.rowwise() -= Eigen::RowVectorXd(data.x.colwise().mean());
    data.y.array() -= data.y.mean();
    const std::optional<double> rms = rms_of_line(data);
    if (!rms || !(*rms < kAlone * rms_of(data.y))) return std::nullopt;
    line.rms = *rms;
    return line;
}

// Returns the error of one straight line through both sessions, with separate zeros.
std::optional<double> rms_of_both(const Line& one, const Line& other, double& spread) {
    Data both{Eigen::MatrixXd(one.data.x.rows() + other.data.x.rows(), one.data.x.cols()),
              Eigen::VectorXd(one.data.x.rows() + other.data.x.rows())};
    both.x << one.data.x, other.data.x;
    both.y << one.data.y, other.data.y;
    spread = rms_of(both.y);
    return rms_of_line(both);
}

// Finds two sessions whose readings follow their loads along different straight lines, so that the line of each is wrong for
// the other, even with its own zero.
void check_agreement(const Labelled& labelled, const std::vector<Rows>& of_session, const Wrench& full_scale,
                     std::vector<std::string>& warnings) {
    for (std::size_t c = 0; c < 6; ++c) {
        std::vector<std::optional<Line>> lines;
        for (const Rows& rows : of_session) lines.push_back(line_of(rows, c));
        bool refused = false;
        const Contradictions found =
            contradictions(of_session.size(), [&](std::size_t a, std::size_t b) -> std::optional<bool> {
                if (!lines[a] || !lines[b]) return std::nullopt;
                double spread = 0;
                const std::optional<double> rms = rms_of_both(*lines[a], *lines[b], spread);
                if (!rms) return std::nullopt;
                const bool contradicts =
                    *rms > kContradicts * spread && *rms > kTimesAlone * std::max(lines[a]->rms, lines[b]->rms);
                refused = refused || (contradicts && *rms > kRefused * spread);
                return contradicts;
            });
        if (found.pairs.empty()) continue;
        const auto [reference, other] = found.shown;
        double spread = 0;
        const std::string text = fmt::format(
            "{}: {} of {} contradicts that of session \"{}\": a straight line errs by {:.2g} and {:.2g} % of full scale in "
            "each of them, but one for both by {:.2g} %, whatever their zeros. Are the channels in another unit, gain or "
            "order, or is the sensor mounted otherwise? {} extends over {:.3g} there and over {:.3g} in session \"{}\". {}",
            verdict(labelled, found), label_column(c), place(labelled, of_session, other), labelled.sessions[reference],
            100 * lines[other]->rms / full_scale[c], 100 * lines[reference]->rms / full_scale[c],
            100 * rms_of_both(*lines[reference], *lines[other], spread).value_or(kNaN) / full_scale[c],
            labelled.channels.front(), width(lines[other]->data), width(lines[reference]->data),
            labelled.sessions[reference], advice(labelled, found));
        if (refused) throw Undetermined(text);
        warnings.push_back(text);
        return;
    }
}

}  // namespace

void check_sessions(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings) {
    if (labelled.sessions.size() < 2) return;
    std::vector<Rows> of_session(labelled.sessions.size());
    for (const auto* row : rows)
        if (row->session < of_session.size()) of_session[row->session].push_back(row);
    const Wrench full_scale = full_scales(rows);
    std::vector<std::size_t> components;
    for (std::size_t c = 0; c < full_scale.size(); ++c)
        if (full_scale[c] > 0) components.push_back(c);
    // The agreement of one line with both sessions does not depend on which axes are loaded together.
    std::vector<Rows> independent = of_session;
    for (Rows& each : independent)
        if (loads_go_together(each, components)) each.clear();
    check_units(labelled, independent, warnings);
    check_orders(labelled, independent, components, warnings);
    check_agreement(labelled, of_session, full_scale, warnings);
}

}  // namespace tactiled
