// The channels of a recording as a robust regression with mixed effects:
//
//     channel_k = zero_k + z_k(session) + gain_k * loads + e
//
// z_k(session) is a random effect with a variance between the sessions, and e has the tails of Cauchy's distribution and a
// size that grows with the load: sigma^2 = noise^2 + (bend * load)^2, because a sensor that is not straight differs more
// from its gains under a greater load. Rows at rest, if there are some, therefore determine the zeros. It is the same for
// all models and methods, since it reads no force from the channels.
#pragma once
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {

// Channels in channel_unit, loads in N or Nm.
struct MixedEffects {
    Rows rows;                            // rows that have all labels of the recording
    std::vector<std::size_t> components;  // indices of the labels in a wrench
    std::vector<std::size_t> session;     // number of each row's session among those that occur
    std::vector<std::size_t> index;       // index of each of these numbers in Labelled::sessions
    Eigen::MatrixXd gain;                 // component x channel
    Eigen::RowVectorXd zero;              // mean over the sessions
    Eigen::MatrixXd session_zero;         // session x channel, about this mean
    Eigen::RowVectorXd zero_sd;           // between sessions, without the scatter of the estimates; of two or more
    Eigen::MatrixXd own_sd;               // session x channel: of the estimate
    std::vector<bool> agrees;             // false for a row that no zero explains, as with a mistyped load
    Eigen::MatrixXd unloaded;             // row x channel: the readings minus zero and loads, with the session's zero
};

// Ceres solves the regression from the convex fit with Huber's loss; variances by expectation and maximisation around it.
// Recordings in which a channel or a label is constant, or with fewer rows than unknowns, give no rows. setup
MixedEffects mixed_effects(const Labelled& labelled, const Rows& rows);

// ---- One channel, for tests ----

struct OneChannel {
    std::vector<double> reading;
    std::vector<std::array<double, 6>> load;  // relative to full scale; 0 for a component without labels
    std::vector<std::size_t> session;
    std::size_t sessions = 0;
};
struct OneFit {
    std::array<double, 7> common{};    // zero and gains
    std::vector<double> session_zero;  // about 0
    double noise = 0, bend = 0;        // sd of e at rest, and its growth at full scale
    double between = 0;                // sd between sessions
    double cost = 0;                   // cost of the last solution
};
// `start`: values of all unknowns in place of the convex fit, zeros of the sessions last; empty: none.
OneFit fit_one_channel(const OneChannel& channel, const std::vector<double>& start = {});

}  // namespace tactiled
