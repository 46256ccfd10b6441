// The straight line of one session compared with the loads of another, by the second moments of both.
#pragma once
#include <optional>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {

// A session in numbers that suffice for straight lines: covariances of its rows that have all labels.
struct SessionMoments {
    Eigen::MatrixXd xx, xy, yy;  // channels with channels, channels with labels, labels with labels
    Eigen::MatrixXd line;        // channels x labels: the straight line of this session
    Eigen::MatrixXd residual;    // channels x channels: row k is channel k less its straight line through the others
    Eigen::VectorXd error;       // this line's, relative to the spread of the labels
};

// Returns true if the session has too few different loads, or loads that go together, so that a line through it may take
// one axis for another. `components`: indices in a wrench.
bool loads_go_together(const Rows& rows, const std::vector<std::size_t>& components);

// Returns nothing if the rows are too few for a straight line, or a label or a channel is constant.
std::optional<SessionMoments> moments_of(const Rows& rows, const std::vector<std::size_t>& components);

// A reason why two sessions contradict each other.
struct Disagreement {
    bool exchanged;    // two channels; else the sensor was turned, or the labels were
    std::size_t a, b;  // these channels; else `a` is the place of a label in `components`
    double error;      // the line of one session in the other, once corrected; relative to the spread of the labels
};

// Returns the reason, or nothing if there is none. Turned: the line of either session says nothing about a label of the
// other, or the opposite, but its other components do. Exchanged: with two channels exchanged back, the lines of both
// sessions err far less in the other one, or predict its channels from each other far better.
std::optional<Disagreement> disagreement(const SessionMoments& one, const SessionMoments& other);

}  // namespace tactiled
