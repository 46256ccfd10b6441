// Sessions of a recording as random effects: each has zeros of its own and gains that differ a little, so that the straight
// line of the others predicts its labels up to an error that can be stated. A session beyond it contradicts the others.
#pragma once
#include <optional>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {

// The rows of a session that have one label, in numbers that suffice for straight lines: covariances.
struct SessionMoments {
    Eigen::MatrixXd xx;  // variances and covariances of the channels
    Eigen::VectorXd xy;  // covariances of the channels with the label
    double yy = 0;       // variance of the label
    double rows = 0;
    std::vector<SessionMoments> parts;  // fifths of its rows, in their order
};

// The lines of some sessions compared with the labels of another one. Errors are relative to the spread of the labels, which
// is the largest of: those of the session, those predicted for it, and those of a usual session.
struct Prediction {
    Eigen::VectorXd line, own, common;  // label per channel: of the others, of the session, of all of them together
    double error = 0;                   // root mean square of the others' line in the session, whatever the zero
    double sd = 0;                      // sd of the error that other gains of the channels make
    double gains = 0;                   // error that other gains of the channels make in one of 1000 recordings
    double limit = 0;                   // error that these, and loads that are not known, explain
    double spread = 0;                  // N or Nm
};

// The sessions of one component; empty where a session has none.
using Moments = std::vector<std::optional<SessionMoments>>;

// All sessions. `component`: those with labels, as indices in a wrench; `moments`: of each of them; `loads`: covariance of
// the labels in each session, in the order of the components.
struct Sessions {
    std::vector<std::size_t> component;
    std::vector<Moments> moments;
    std::vector<Eigen::MatrixXd> loads;
    std::vector<double> rows;
};
Sessions sessions_of(const std::vector<Rows>& of_session);

// The reason why the line of the others is not right for a session.
struct Contradiction {
    // factor: of the labels of a component; exchange: of two channels; turn: labels of a component belong to other axes, or
    // have the other sign; unknown: no line serves both. The correction, or a line of its own, lowers the error by a third
    // in each fifth of the session, and the error is beyond what other gains do.
    enum class Cause { unknown, factor, exchange, turn } cause = Cause::unknown;
    std::size_t component = 0;  // in Sessions::component
    Prediction prediction;      // prediction of this component
    double factor = 1;
    std::size_t a = 0, b = 0;  // channels
    double left = 0;           // error with the correction, relative to the spread of the session's labels
};

// Compares a session with the line of others, which have loads like its own. Returns nothing if it agrees, or cannot be
// compared.
std::optional<Contradiction> contradiction(const Sessions& sessions, const std::vector<std::size_t>& by,
                                           std::size_t session);

// The sessions that contradict the others.
struct SessionVerdict {
    std::vector<std::size_t> compared;  // in order
    std::vector<std::size_t> odd;       // in order, fewer than half of those compared; empty: none, or no minority
    std::optional<std::pair<std::size_t, std::size_t>> pair;  // two that contradict each other, without a minority
    std::vector<Contradiction> why;                           // reasons of each of `odd`, or of the second of the pair
};

// Compares each session with the line of all others that agree with each other. setup
SessionVerdict contradicting(const Sessions& sessions);

// Returns the error of a line in a session, relative to `spread`.
double error_of_line(const Eigen::VectorXd& line, const SessionMoments& session, double spread);

}  // namespace tactiled
