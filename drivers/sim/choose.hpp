// Selection of the effects that a scene calls for. The rest is left out with a guaranteed error.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "drivers/sim/parts.hpp"
#include "drivers/sim/scene.hpp"

namespace tactiled::sim {

struct Decision {
    const EffectEntry* effect;
    Bound bound;
    bool on;
    std::string_view why;         // "needed", "left out: within the wanted accuracy", "cannot occur here", "asked for", ...
    double cost_ns = 0;           // cost of the effect itself: cost_ns()
    std::vector<Level> levels{};  // levels that it offers here
    std::vector<double> level_cost_ns{};  // cost of each level
    static constexpr std::size_t kItself = SIZE_MAX;
    std::size_t level = kItself;  // its level, where it is on
    // Where it is on: the parts of the scene (Choice::parts) in which it rests, and its bound in each of them, N. Empty: it
    // never rests.
    std::vector<bool> rests{};
    std::vector<double> part_N{};
    double active_share = 1;  // of the scene's samples, where it is on

    // Error that it makes by itself at its place in the chain, N: its bound where it is off, that of its level.
    [[nodiscard]] double error_N() const { return !on ? bound.change_N : level == kItself ? 0 : levels[level].error_N; }
    // Its mean cost over the scene as it is now.
    [[nodiscard]] double spent_ns() const {
        return !on ? 0 : active_share * (level == kItself ? cost_ns : level_cost_ns[level]);
    }
};

struct Choice {
    std::vector<Decision> decisions;  // of the effects that concern the sensor, in the order of the chain
    double wanted_N;
    double guaranteed_N;        // no channel differs by more from what all effects together would give
    std::vector<Part> parts{};  // of the scene, where some effect rests in one
};

// `request`: "auto", "all", "none" or names with commas, NAME or NAME:LEVEL. Auto takes the cheapest set of effects and
// levels with which guaranteed_N stays at or below wanted_N. The same on every machine. setup: throws SetupError for a name
// that is none, and for a level that the effect does not offer here
Choice choose(const Scene& scene, const Sensor& sensor, const Extent& extent, const std::string& request);

// When an effect that is on is active, in s since the scene began: all of the scene but for its rests.
std::vector<std::pair<double, double>> active_s(const Scene& scene, const Choice& choice, const Decision& decision);

// The error at the end of the chain by what is left out and by cheaper levels: along the chain, each adds its own
// (Decision::error_N), and each that is on hands on what was there before it by its gain and its jump.
double guaranteed_error_N(const std::vector<Decision>& decisions);

// Leaves out and lowers to cheaper levels: the least sum of costs of all choices with guaranteed_error_N() <= wanted_N, but
// for those whose errors on the way lie within 1/500 of wanted_N of each other, of which the cheapest is followed. No effect
// that is on afterwards could go or be lowered with the others as they are.
void leave_out(std::vector<Decision>& decisions, double wanted_N);

// Lets instant effects that are on rest in parts of the scene, dearest first, while the guarantee holds in every part.
// setup
void let_rest(const Scene& scene, const Sensor& sensor, Choice& choice);

}  // namespace tactiled::sim
