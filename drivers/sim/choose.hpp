// Selects the effects that a scene needs. The other effects are left out with a guaranteed error.
#pragma once
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "drivers/sim/scene.hpp"

namespace tactiled::sim {

// A part of a scene: consecutive whole segments. An effect may be suspended in one part although another part needs it.
struct Part {
    std::size_t first_segment, last_segment;  // both included
    double begin_s, end_s;
    // Samples that are within the part for every effect of time; whole blocks.
    std::uint64_t first_sample, end_sample;
};

// At most 16 parts that cover the scene; short ones are merged with a neighbour. `margin_s`: maximum difference between the
// actual and the nominal time of a sample. setup
std::vector<Part> parts_of(const Scene& scene, double margin_s);

struct Decision {
    const EffectEntry* effect;
    Bound bound;
    bool on;
    std::string_view why;         // "needed", "left out: within the wanted accuracy", "cannot occur here", "asked for", ...
    double cost_ns = 0;           // cost of the effect itself: cost_ns()
    std::vector<Level> levels{};  // levels available here
    std::vector<double> level_cost_ns{};  // cost of each level
    static constexpr std::size_t kItself = SIZE_MAX;
    std::size_t level = kItself;  // its level, where it is on
    // If it is on: the parts of the scene (Choice::parts) in which it is suspended, and its bound in each part, N. Empty: it
    // is never suspended.
    std::vector<bool> rests{};
    std::vector<double> part_N{};
    double active_share = 1;  // share of the scene's samples in which it is active, if it is on

    // Place of the effect in chain().
    [[nodiscard]] std::size_t number() const;
    // Error of the effect at its place in the chain, N: its bound if it is off, the error of its level if it is on.
    [[nodiscard]] double error_N() const { return !on ? bound.change_N : level == kItself ? 0 : levels[level].error_N; }
    // Mean cost of the effect over the scene with the present decision, ns per sample.
    [[nodiscard]] double spent_ns() const {
        return !on ? 0 : active_share * (level == kItself ? cost_ns : level_cost_ns[level]);
    }
};

struct Choice {
    std::vector<Decision> decisions;  // the effects that concern the sensor, in the order of the chain
    double wanted_N;
    double guaranteed_N;        // no channel differs by more from what all effects together would give
    std::vector<Part> parts{};  // if an effect is suspended in some of them
};

// Chooses effects. `request`: "auto", "all", "none" or a list with commas of NAME or NAME:LEVEL. Auto takes the
// cheapest set of effects and levels with which guaranteed_N is at most wanted_N. The choice is the same on every
// machine. setup: throws SetupError for an unknown name, and for a level that the effect does not offer here
Choice choose(const Scene& scene, const Sensor& sensor, const Extent& extent, const std::string& request);

// Returns the intervals, in s since the scene began, in which an effect that is on is not suspended.
std::vector<std::pair<double, double>> active_s(const Scene& scene, const Choice& choice, const Decision& decision);

// Returns the error at the end of the chain that is caused by left-out effects and cheaper levels. Each effect adds its own
// error (Decision::error_N); each effect that is on multiplies the error before it by its gain and adds its jump.
double guaranteed_error_N(const std::vector<Decision>& decisions);

// Leaves out effects or lowers their levels for the minimum sum of costs with guaranteed_error_N() <= wanted_N.
// Combinations whose intermediate errors differ by less than 1/500 of wanted_N are merged to the cheapest one.
// Afterwards no single effect could be left out or lowered with the others unchanged.
void leave_out(std::vector<Decision>& decisions, double wanted_N);

// Returns the places of the decisions, the most expensive effect first.
std::vector<std::size_t> by_cost(const std::vector<Decision>& decisions);

// Suspends instant effects in parts of the scene, the most expensive effect first, as long as the guarantee holds in every
// part. setup
void let_rest(const Scene& scene, const Sensor& sensor, Choice& choice);

}  // namespace tactiled::sim
