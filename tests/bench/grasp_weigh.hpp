// Statistics over many sessions of grasps.
#pragma once
#include <string>
#include <vector>

#include "tests/bench/grasp_session.hpp"

namespace tactiled::bench {

// The four objects of Cao et al.: three eggs, a ball.
inline const std::vector<double> kEggsAndBall_kg{0.5024 / 9.80665, 0.5580 / 9.80665, 0.6237 / 9.80665, 0.1356 / 9.80665};

// Object k + 1 as it was weighed in the grasps of `outcomes` by so many jaws: mean and standard deviation.
std::vector<grasp::Object> taught_by(const std::vector<Outcome>& outcomes, std::size_t sensed);

struct Figures {
    int n = 0, never = 0, in_300_ms = 0, within_1_sd = 0, within_2_sd = 0, right = 0, unknown = 0, wrong = 0;
    int wrong_kind = 0;       // the ball for an egg or an egg for the ball
    double bias = 0, sd = 0;  // relative to the weight
    double said_sd = 0;       // published sd, mean
    double p50_s = 0, p95_s = 0;
    double shown = 0;  // lifts of the known weight until it was accepted, mean
};
// Statistics of one object (SIZE_MAX: all) with that number of sensed jaws, from the first stable value.
Figures figures(const std::vector<Outcome>& outcomes, std::size_t object, std::size_t sensed);

// All of `sessions` sessions of 5 grasps of each object, with objects taught by as many jaws in `teaching` sessions before.
std::vector<Outcome> weigh(std::uint64_t first_seed, int sessions, int teaching, const Conditions& c);

}  // namespace tactiled::bench
