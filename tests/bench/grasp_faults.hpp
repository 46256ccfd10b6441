// Grasps of a hand with a damaged jaw, a wrong set-up or an unreported motion, to find wrong weights that seem good.
#pragma once
#include <cstdint>
#include <span>
#include <string_view>

namespace tactiled::bench {

enum class Fault {
    none,
    dead_shear,
    reversed,
    gravity_reversed,
    half_gain,
    gain_creeps,
    zero_drifts,
    both_zeros_drift,
    tilted,
    swings_up,
    swings_later,
    turned_90,
    exchanged,
    half_rate,
    late,
    slow_lift,
    cable,
    table,
    // Causes that the checks were not designed for:
    gain_drifts,
    stamped_late,
    leaks_mass,
    jaw_on_table,
    second_object,
    upside_down,
    gravity_size
};

struct FaultKind {
    Fault fault;
    std::string_view name;
    unsigned jaws;     // 0: two or three
    bool forces_tell;  // the forces show it; false: listed with its size
    bool harmless;     // the weight stays right, so it may be stable
};
std::span<const FaultKind> fault_kinds();

struct FaultFigures {
    int n = 0;
    int wrong = 0;           // grasps with a STABLE weight that was off by more than 4 of its sd, at any time
    int ever_stable = 0;     // grasps that were STABLE at any time
    int lost = 0;            // number of these that were no longer STABLE at the end
    int reported = 0;        // grasps with a doubt that names a reason other than motion, at any time after the lift
    int named = 0;           // number of these in which the damaged jaw was named
    double worst_sds = 0;    // largest error of a STABLE weight, in its sd
    double worst_error = 0;  // the same error, of the weight
};

// The objects, presses and shares of development; those that judge are other ones, of a wider range.
enum class Objects { development, judging };

// `n` random grasps of one kind, of hands with `jaws` jaws where the kind does not say it; 0: two or three. Deterministic by
// `seed`.
FaultFigures fault_figures(const FaultKind& kind, int n, std::uint64_t seed, Objects objects, unsigned jaws = 0);

}  // namespace tactiled::bench
