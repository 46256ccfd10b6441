// The straight line of one session compared with the loads of another, by the second moments of both, and the sessions
// that contradict the others.
#pragma once
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {

// ---- session_pairs.cpp ----

// A session in numbers that suffice for straight lines: covariances of its rows that have all labels.
struct SessionMoments {
    Eigen::MatrixXd xx, xy, yy;  // channels with channels, channels with labels, labels with labels
    Eigen::MatrixXd line;        // channels x labels: the straight line of this session
    Eigen::MatrixXd residual;    // channels x channels: row k is channel k minus its straight line through the others
    Eigen::VectorXd error;       // error of this line, relative to the spread of the labels
};

// Returns true if the session has too few different loads, or loads that vary together, so that a line through the session
// may confuse axes. `components`: indices in a wrench.
bool loads_go_together(const Rows& rows, const std::vector<std::size_t>& components);

// Returns nothing if the rows are too few for a straight line, or a label or a channel is constant.
std::optional<SessionMoments> moments_of(const Rows& rows, const std::vector<std::size_t>& components);

// A reason why two sessions contradict each other.
struct Disagreement {
    bool exchanged;    // two channels were exchanged; otherwise the sensor or the labels were rotated
    std::size_t a, b;  // the channels; otherwise `a` is the place of a label in `components`
    double error;      // error of a session's line in the other one after the correction, relative to the labels' spread
};

// Returns the reason, or nullopt. Turned: the line of each session does not predict a label of the other, or predicts the
// opposite, although its other components do. Exchanged: with two channels exchanged back, the lines of both sessions have
// far smaller errors in the other session, or predict its channels far better.
std::optional<Disagreement> disagreement(const SessionMoments& one, const SessionMoments& other);

// ---- session_verdict.cpp: the sessions that contradict the others, and their messages ----

// Sessions that contradict each other by one check.
struct Contradictions {
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    std::vector<std::size_t> compared;            // in order
    std::vector<std::size_t> odd;                 // sessions in the minority, in order; empty: no minority
    bool doubtful = false;                        // one of `odd` contradicts no more than half of the others compared
    std::pair<std::size_t, std::size_t> shown{};  // for the message: the trusted or earlier session, and another
};

// Compares each session with the next six, cyclically. `contradict` returns nothing where it cannot compare.
Contradictions contradictions(std::size_t sessions,
                              const std::function<std::optional<bool>(std::size_t, std::size_t)>& contradict);

// Returns the first part of a message, which names the sessions, and the last part, which states the remedy.
std::string verdict(const Labelled& labelled, const Contradictions& found);
std::string advice(const Labelled& labelled, const Contradictions& found);

}  // namespace tactiled
