#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/fit/recording_checks.hpp"
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
// Errors of straight lines relative to the labels' spread: of one for each session at most, of one for both sessions from
// which on they contradict each other, and from which on they are not calibrated together; over the error of one for each.
constexpr double kAlone = 0.5, kContradicts = 0.3, kRefused = 0.5, kTimesAlone = 2;

struct Data {
    Eigen::MatrixXd x;
    Eigen::VectorXd y;
};

Data data_of(const Rows& rows, std::size_t c) {
    Rows known;
    for (const auto* row : rows)
        if (std::isfinite(row->wrench_S[c])) known.push_back(row);
    const auto n = Eigen::Index(rows.front()->channel.size());
    Data data{Eigen::MatrixXd(Eigen::Index(known.size()), n), Eigen::VectorXd(Eigen::Index(known.size()))};
    for (std::size_t i = 0; i < known.size(); ++i) {
        data.x.row(Eigen::Index(i)) = Eigen::Map<const Eigen::RowVectorXd>(known[i]->channel.data(), n);
        data.y[Eigen::Index(i)] = known[i]->wrench_S[c];
    }
    return data;
}

// The range of the first channel.
double width(const Data& data) { return data.x.col(0).maxCoeff() - data.x.col(0).minCoeff(); }

// A session whose labels are in another unit than those of the session before, or have another sign: the straight line
// of one session predicts the other but for this factor.
void check_units(const Labelled& labelled, const std::vector<Rows>& of_session) {
    for (std::size_t s = 1; s < of_session.size(); ++s)
        for (std::size_t c = 0; c < 6; ++c) {
            if (of_session[s - 1].size() < kFewestRows || of_session[s].size() < kFewestRows) continue;
            const Data before = data_of(of_session[s - 1], c), here = data_of(of_session[s], c);
            if (before.x.rows() < 3 * (before.x.cols() + 1) || here.x.rows() < Eigen::Index(kFewestRows)) continue;
            const Affine affine = affine_fit(before.x, before.y);
            if (!affine.slope.dependent.empty()) continue;
            const Eigen::VectorXd says = here.x * affine.slope.coefficient;
            const Eigen::ArrayXd a = says.array() - says.mean(), b = here.y.array() - here.y.mean();
            const double factor = (a * b).sum() / a.square().sum();
            const double correlation = (a * b).sum() / std::sqrt(a.square().sum() * b.square().sum());
            if (!(std::abs(correlation) > kCorrelated)) continue;
            for (const Unit& unit : kUnits)
                for (const double ratio : {factor, 1 / factor})
                    if (std::abs(ratio / unit.factor - 1) < kNearUnit)
                        throw Undetermined(
                            fmt::format("{} of session \"{}\" (from {}:{} on) is {:.3g} times that of session \"{}\" for "
                                        "the same readings: {}. Or are its channels in another unit? {} extends over "
                                        "{:.3g} there and over {:.3g} in session \"{}\"",
                                        label_column(c), labelled.sessions[s], labelled.name, of_session[s].front()->line,
                                        factor, labelled.sessions[s - 1], unit.remark, labelled.channels.front(),
                                        width(here), width(before), labelled.sessions[s - 1]));
        }
}

// The straight line through the readings of one session and its error.
struct Line {
    Data data;  // less their means
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

// Two sessions whose readings follow their loads along another straight line each: what one of them shows is wrong for
// the other, even with its own zero.
void check_agreement(const Labelled& labelled, const std::vector<Rows>& of_session, const Wrench& full_scale,
                     std::vector<std::string>& warnings) {
    for (std::size_t c = 0; c < 6; ++c) {
        std::optional<Line> first;
        std::size_t of_first = 0;
        for (std::size_t s = 0; s < of_session.size(); ++s) {
            std::optional<Line> line = line_of(of_session[s], c);
            if (!line) continue;
            if (!first) {
                first = std::move(line);
                of_first = s;
                continue;
            }
            Data both{Eigen::MatrixXd(first->data.x.rows() + line->data.x.rows(), first->data.x.cols()),
                      Eigen::VectorXd(first->data.x.rows() + line->data.x.rows())};
            both.x << first->data.x, line->data.x;
            both.y << first->data.y, line->data.y;
            const std::optional<double> rms = rms_of_line(both);
            if (!rms || !(*rms > kContradicts * rms_of(both.y)) || !(*rms > kTimesAlone * std::max(first->rms, line->rms)))
                continue;
            const std::string& name = labelled.sessions[of_first];
            const std::string text = fmt::format(
                "{} of session \"{}\" (from {}:{} on) contradicts that of session \"{}\": a straight line errs by {:.2g} "
                "and {:.2g} % of full scale in each of them, but one for both by {:.2g} %, whatever their zeros. Are the "
                "channels in another unit, gain or order, or is the sensor mounted otherwise? {} extends over {:.3g} there "
                "and over {:.3g} in session \"{}\". Calibrate sessions that agree: --session {}",
                label_column(c), labelled.sessions[s], labelled.name, of_session[s].front()->line, name,
                100 * line->rms / full_scale[c], 100 * first->rms / full_scale[c], 100 * *rms / full_scale[c],
                labelled.channels.front(), width(line->data), width(first->data), name,
                labelled.sessions.size() == 2 ? name : "A,B");
            if (*rms > kRefused * rms_of(both.y)) throw Undetermined(text);
            warnings.push_back(text);
            return;
        }
    }
}

}  // namespace

void check_sessions(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings) {
    if (labelled.sessions.size() < 2) return;
    std::vector<Rows> of_session(labelled.sessions.size());
    for (const auto* row : rows)
        if (row->session < of_session.size()) of_session[row->session].push_back(row);
    check_units(labelled, of_session);
    check_agreement(labelled, of_session, full_scales(rows), warnings);
}

}  // namespace tactiled
