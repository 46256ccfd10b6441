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
    Eigen::MatrixXd xx;  // of the channels
    Eigen::VectorXd xy;  // of the channels with the label
    double yy = 0;       // variance of the label
    double rows = 0;
    // Error of the line of four fifths of its time in the other fifth, N or Nm: a straight line holds for some places and
    // loads only, whatever the session.
    double within = 0;
};

// What the line of some sessions says of another one. Errors are relative to the spread of the labels, which is the largest
// of: those of the session, those predicted for it, and those of a usual session.
struct Prediction {
    Eigen::VectorXd line;  // label per channel
    double error = 0;      // root mean square, whatever the zero
    double alone = 0;      // of a line of the session's own, in a part of it that it has not seen
    double limit = 0;      // a greater error is a contradiction
    double spread = 0;     // N or Nm
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

// The sessions that contradict the others.
struct SessionVerdict {
    std::vector<std::size_t> compared;  // in order
    std::vector<std::size_t> odd;       // in order, fewer than half of those compared; empty: none, or no minority
    std::optional<std::pair<std::size_t, std::size_t>> pair;  // where there is no minority: two of them that contradict
};

// Compares each session with the line of all others that agree with each other, if these have loads like its own. Level: one
// false contradiction in 1000 recordings. setup
SessionVerdict contradicting(const Sessions& sessions);

// Returns what the sessions of `by` say of session `of`.
Prediction predict(const Moments& sessions, const std::vector<std::size_t>& by, std::size_t of, std::size_t comparisons);

// Returns the error of a line in a session, relative to `spread`.
double error_of_line(const Eigen::VectorXd& line, const SessionMoments& session, double spread);

}  // namespace tactiled
