// Number of steps of the two iterative methods, from a cold start and from the last sample: method "map" of the table
// sensor, method "overlap" of the capacitive one. Readings are made from the solver's own model, so the error is its own
// alone.
#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <random>

#include "decoupling/capacitive/overlap_solver.hpp"
#include "decoupling/capacitive/pad.hpp"
#include "decoupling/table/point_search.hpp"
#include "tests/bench/costs/influence.hpp"
#include "tests/bench/costs/turns.hpp"

namespace tactiled::ctl {
namespace {

constexpr std::size_t kCases = 256;
constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kMove_m = 2e-5;        // between two samples: a finger that slides at 20 mm/s, 1 kHz
constexpr double kMoveOfRadius = 4e-3;  // the same of the pad's upper disc, 5 mm
constexpr std::uint32_t kAllGauges = 0xFF;
constexpr unsigned kAllElectrodes = (1u << kElectrodes) - 1;
constexpr double kMinDrawn = 1e-9;
constexpr double kGood = 1e-3;  // limit of the force error: far below any calibration

struct Case {  // one tested variant: its name, its result for case i, and its error
    std::string solver;
    int steps;
    std::function<double(std::size_t)> error;  // error of the force vector, relative
};

// ---- method map ----

struct Touch {
    Eigen::Vector3d force_N;
    Gauges reading;
    Eigen::Vector2d last_m;  // place of the contact one sample before
};

struct Plate {
    std::unique_ptr<PointSolver> solver;
    std::unique_ptr<PointSearch> search;
    std::vector<Touch> touches;
};

Plate plate_of(const CostSetup& setup) {
    const Calibration calibration = influence_calibration(setup);
    std::string fault;
    auto map = influence_of(calibration, fault);
    if (!map) throw SetupError(fmt::format("{}: {}", setup.influence_path(), fault));
    Plate plate{std::make_unique<PointSolver>(*std::move(map)), nullptr, {}};
    plate.search = std::make_unique<PointSearch>(*plate.solver);
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (std::size_t i = 0; i < kCases; ++i) {
        const double r_m = 0.9e-3 * std::sqrt(uniform(random)), cycle = kTurn * uniform(random),
                     heading = kTurn * uniform(random);
        const double press_N = 0.5 + 0.5 * uniform(random), shear_N = 0.5 * press_N * uniform(random),
                     to = kTurn * uniform(random);
        Touch touch{{shear_N * std::cos(to), shear_N * std::sin(to), -press_N}, {}, {}};
        const Eigen::Vector2d point_m(r_m * std::cos(cycle), r_m * std::sin(cycle));
        InfluenceMap::At at;
        plate.solver->map().at(point_m.x(), point_m.y(), at);
        touch.reading = at.value * touch.force_N;
        touch.last_m = point_m + kMove_m * Eigen::Vector2d(std::cos(heading), std::sin(heading));
        plate.touches.push_back(touch);
    }
    return plate;
}

double error_of(const PointContact& found, const Touch& touch) {
    return (found.force_N - touch.force_N).norm() / touch.force_N.norm();
}

void add_map(const Plate& plate, std::vector<Case>& cases) {
    for (const int steps : {1, 2, 3, 4, 6}) {
        cases.push_back({"map, from the middle", steps, [&plate, steps](std::size_t i) {
                             const Touch& touch = plate.touches[i];
                             return error_of(plate.solver->refine(touch.reading, kAllGauges, PointContact{}, steps), touch);
                         }});
        cases.push_back({"map, from the last sample", steps, [&plate, steps](std::size_t i) {
                             const Touch& touch = plate.touches[i];
                             return error_of(
                                 plate.solver->refine(touch.reading, kAllGauges, contact_at(touch.last_m), steps), touch);
                         }});
    }
    cases.push_back({"map, whole search", 0, [&plate](std::size_t i) {
                         const Touch& touch = plate.touches[i];
                         plate.search->run(touch.reading, kAllGauges, 1e-4 * touch.reading.squaredNorm() / 8);
                         return error_of(plate.search->found(), touch);
                     }});
}

// ---- method overlap ----

struct Squeeze {
    OverlapSolver::State truth, last;
    OverlapSolver::Electrodes reading;
};

struct Pad {
    std::unique_ptr<OverlapSolver> solver;
    PadLaw law;
    std::vector<Squeeze> squeezes;
};

// The simulator's sensor: drivers/sim/capacitive.cpp.
Pad pad_of() {
    const ElectrodeGeometry geometry{5e-3, 3e-3, 7e-3, 80.0 / 360 * kTurn, 2e-3, 3e-3};
    Pad pad{std::make_unique<OverlapSolver>(std::array<double, kElectrodes>{0.09, 0.09, 0.09, 0.09, 0.1}, geometry),
            PadLaw{31, 0.1, 1195 * geometry.disc_radius_m, -0.4, geometry.gap_m / geometry.disc_radius_m},
            {}};
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (std::size_t i = 0; i < kCases; ++i) {
        const double shift = 0.3 * uniform(random), cycle = kTurn * uniform(random);
        Squeeze squeeze{{0.05 + 0.4 * uniform(random), shift * std::cos(cycle), shift * std::sin(cycle)}, {}, {}};
        squeeze.last = {squeeze.truth.v * 0.99, squeeze.truth.x + kMoveOfRadius, squeeze.truth.y};
        OverlapSolver::Electrodes rest;
        OverlapSolver::Jacobian unused;
        pad.solver->linearise(squeeze.truth, OverlapSolver::Electrodes::Zero(), kAllElectrodes, rest, unused);
        squeeze.reading = -rest;
        pad.squeezes.push_back(squeeze);
    }
    return pad;
}

double error_of(const Pad& pad, const OverlapSolver::State& found, const OverlapSolver::State& truth) {
    const auto force = [&](const OverlapSolver::State& s) {
        const double k = pad.law.shear_stiffness_at(s.v);
        return Eigen::Vector3d(k * s.x, k * s.y,
                               pad.law.press_N(s.v) + pad.law.press_by_shift_N(s.v, s.x * s.x + s.y * s.y));
    };
    return (force(found) - force(truth)).norm() / force(truth).norm();
}

void add_overlap(const Pad& pad, std::vector<Case>& cases) {
    for (const int steps : {1, 2, OverlapSolver::kMaxSteps}) {
        cases.push_back({"overlap, from first order", steps, [&pad, steps](std::size_t i) {
                             const Squeeze& s = pad.squeezes[i];
                             const auto from = pad.solver->start(s.reading, kAllElectrodes);
                             return error_of(pad, pad.solver->solve(s.reading, kAllElectrodes, from, steps).state, s.truth);
                         }});
        cases.push_back({"overlap, from the last sample", steps, [&pad, steps](std::size_t i) {
                             const Squeeze& s = pad.squeezes[i];
                             return error_of(pad, pad.solver->solve(s.reading, kAllElectrodes, s.last, steps).state,
                                             s.truth);
                         }});
    }
}

Cost measure(const CostSetup& setup) {
    const Plate plate = plate_of(setup);
    const Pad pad = pad_of();
    std::vector<Case> cases;
    add_map(plate, cases);
    add_overlap(pad, cases);
    std::vector<Contender> contenders;
    for (const Case& one : cases)
        contenders.push_back([&one](std::size_t first, std::size_t last) {
            double sum = 0;
            for (std::size_t i = first; i < last; ++i) sum += one.error(i % kCases);
            return sum;
        });
    const auto ns = ns_alternating(contenders, setup.samples_or(6'400));
    Cost cost;
    cost.columns = {"solver", "most_steps", "ns", "force_error_median", "force_error_90"};
    const Symbol symbols[] = {Symbol::ring, Symbol::circle, Symbol::triangle, Symbol::diamond, Symbol::square};
    double min_steps_map = kNaN, min_steps_overlap = kNaN, warm_ns = 0, search_ns = 0, overlap_cold_ns = 0,
           overlap_warm_ns = 0;
    for (std::size_t k = 0; k < cases.size(); ++k) {
        std::vector<double> errors;
        for (std::size_t i = 0; i < kCases; ++i) errors.push_back(cases[k].error(i));
        const double half = quantile(errors, 0.5), max = quantile(errors, 0.9);
        const auto& [name, steps, unused] = cases[k];
        cost.rows.push_back({name, {double(steps), ns[k], half, max}});
        auto series = std::find_if(cost.figure.series.begin(), cost.figure.series.end(),
                                   [&, &n = name](const auto& s) { return s.name == n; });
        if (series == cost.figure.series.end())
            series = cost.figure.series.insert(series, {name, symbols[cost.figure.series.size()], Stroke::solid});
        series->points.push_back({ns[k], std::max(max, kMinDrawn), steps > 0 ? fmt::format("{}", steps) : "search"});
        if (name == "map, from the last sample" && max <= kGood && std::isnan(min_steps_map))
            min_steps_map = steps, warm_ns = ns[k];
        if (name == "map, whole search") search_ns = ns[k];
        if (name == "overlap, from first order" && max <= kGood && std::isnan(min_steps_overlap)) min_steps_overlap = steps;
        if (steps == OverlapSolver::kMaxSteps && name == "overlap, from first order") overlap_cold_ns = ns[k];
        if (steps == OverlapSolver::kMaxSteps && name == "overlap, from the last sample") overlap_warm_ns = ns[k];
    }
    cost.figure.title = "Iterations: error of the force against time, nine of ten are better";
    cost.figure.x = {"time a sample, ns (the solver alone; beside a point: its steps at most)", true};
    cost.figure.y = {"error of the force, part of it (10\u207b\u2079: that or less)", true};
    const double saved = 1 - overlap_warm_ns / overlap_cold_ns;
    cost.advice = fmt::format(
        "Start map from the last sample: {:g} steps, {:.2f} us, come within {:g} of the force, a whole search takes "
        "{:.0f} us; start overlap anew: {} enough for that, and from the last sample it would {}.",
        min_steps_map, warm_ns / 1000, kGood, search_ns / 1000,
        min_steps_overlap == 1 ? "one step is" : fmt::format("{:g} steps are", min_steps_overlap),
        saved > 0.05 ? fmt::format("save {:.0f} % of {:.2f} us", 100 * saved, overlap_cold_ns / 1000)
                     : std::string("be no faster"));
    return cost;
}

}  // namespace

extern const CostEntry solver_cost;
const CostEntry solver_cost{"solver", "iterations and where they start: error against time", "decoupling/costs_solver.svg",
                            measure};

}  // namespace tactiled::ctl
