// Choice of effects in the simulator: none, those that a scene calls for, all. Error against time, scene by scene.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "node/lab/simulate.hpp"
#include "tests/bench/costs/cost.hpp"

namespace tactiled::ctl {
namespace {

constexpr const char* kScenes[] = {"quasi_static", "press_ramp", "grasp_egg", "capacitive_shear"};

Cost measure(const CostSetup& setup) {
    Cost cost;
    cost.columns = {"scene", "none_ns", "auto_ns", "all_ns", "none_error_mN", "auto_error_mN", "wanted_mN", "effects_on"};
    Figure::Series none{"none", Symbol::ring, Stroke::none}, chosen{"auto", Symbol::circle, Stroke::none},
        all{"all: the measure of the others", Symbol::square, Stroke::none},
        wanted{"wanted accuracy", Symbol::none, Stroke::dashed, {}, kInk};
    double worst_none = 0, worst_auto = 0, min_share = std::numeric_limits<double>::infinity(), max_share = 0,
           fastest_ns = 1e300, slowest_ns = 0;
    for (const char* name : kScenes) {
        sim::Scene scene = sim::read_scene(fmt::format("{}/config/scenes/{}.toml", setup.folder, name));
        if (setup.samples > 0) scene.samples = std::min<std::uint64_t>(scene.samples, setup.samples);
        const Measured with_auto = ctl::measure(scene, "auto", 0), without = ctl::measure(scene, "none", 0);
        const sim::Simulation simulation(scene, "auto");
        const auto& decisions = simulation.choice(0).decisions;
        const auto on = std::count_if(decisions.begin(), decisions.end(), [](const auto& decision) { return decision.on; });
        const double wanted_N = scene.wanted_N(scene.sensors[0]);
        cost.rows.push_back({name,
                             {with_auto.none_ns, with_auto.chosen_ns, with_auto.all_ns, without.difference_N * 1e3,
                              with_auto.difference_N * 1e3, wanted_N * 1e3, double(on)}});
        const double none_error = without.difference_N / wanted_N, auto_error = with_auto.difference_N / wanted_N,
                     share = with_auto.chosen_ns / with_auto.all_ns;
        none.points.push_back({with_auto.none_ns, none_error, name});
        chosen.points.push_back({with_auto.chosen_ns, auto_error, name});
        all.points.push_back({with_auto.all_ns, 0, name});
        worst_none = std::max(worst_none, none_error);
        worst_auto = std::max(worst_auto, auto_error);
        min_share = std::min(min_share, share);
        max_share = std::max(max_share, share);
        fastest_ns = std::min(fastest_ns, with_auto.none_ns);
        slowest_ns = std::max(slowest_ns, with_auto.all_ns);
    }
    wanted.points = {{fastest_ns, 1, ""}, {slowest_ns, 1, ""}};
    cost.figure = {"Simulator: error against time, effects none, auto and all",
                   {"time a sample of one sensor, ns", true},
                   {"difference from all effects / wanted", true},
                   {none, chosen, all, wanted}};
    cost.advice = fmt::format(
        "{}: over {} scenes it is off by at most {:.2f} of the wanted accuracy in {:.0f} to {:.0f} % "
        "of the time of all effects; none is off by up to {:.1f} times the wanted accuracy.",
        worst_auto <= 1 ? "Take effects auto" : "Take all effects, auto breaks its promise", std::size(kScenes), worst_auto,
        100 * min_share, 100 * max_share, worst_none);
    return cost;
}

}  // namespace

extern const CostEntry fidelity_cost;
const CostEntry fidelity_cost{"fidelity", "simulator with effects none, auto and all: error against time",
                              "drivers/sim/costs_fidelity.svg", measure};

}  // namespace tactiled::ctl
