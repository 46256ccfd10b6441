// Selection of the effects that a scene calls for. The rest is left out with a guaranteed error.
#pragma once
#include <string>
#include <vector>

#include "drivers/sim/scene.hpp"

namespace tactiled::sim {

struct Decision {
    const EffectEntry* effect;
    Bound bound;
    bool on;
    std::string_view why;  // "needed", "left out: within the wanted accuracy", "cannot occur here", "asked for", ...
};

struct Choice {
    std::vector<Decision> decisions;  // of the effects that concern the sensor, in the order of the chain
    double wanted_N;
    double guaranteed_N;  // no channel differs by more from what all effects together would give
};

// `wish`: "auto", "all", "none" or names with commas. Auto leaves out, in the order of bound / instructions, what it can
// while guaranteed_N stays at or below wanted_N. The same on every machine. setup: throws SetupError for a name that is none
Choice choose(const Scene& scene, const Sensor& sensor, const Extent& extent, const std::string& request);

// The error that leaving out those with on = false can make at the end of the chain: along the chain, each that is left out
// adds its bound, each that is on hands on what was there before it by its gain and its jump.
double guaranteed_error_N(const std::vector<Decision>& decisions);

// Leaves out what it can, by bound over instructions, the least first, until nothing more can go: what is left out later may
// lower the gain of what an earlier one had to pass.
void leave_out(std::vector<Decision>& decisions, double wanted_N);

}  // namespace tactiled::sim
