// The parts of `tactilectl simulate`, one file each.
#pragma once
#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "drivers/sim/simulation.hpp"
#include "node/lab/chart/figure.hpp"
#include "node/lab/port.hpp"
#include "node/lab/progress.hpp"

namespace tactiled::ctl {

// ---- simulate_csv.cpp: signals.csv and truth.csv ----

// Writes the files. Either path may be empty, or "-" for standard output. One sensor: plain columns and a row for
// each frame that arrives. Several: NAME.COLUMN and a row if any arrives. Both files have the same rows. setup:
// throws SetupError where a file cannot be created, std::runtime_error where it cannot be written
void write_csv(const sim::Scene& scene, const std::string& effects, const std::string& signals, const std::string& truth);

// ---- simulate_pty.cpp: the scene as a device ----

// Plays the scene on one pty per sensor, in the scene's order, or on one for all of them in format cobs, which names
// the device of each frame. Returns the exit status. setup: throws SetupError
int play_scene(const sim::Scene& scene, const std::string& effects, const std::vector<std::string>& ptys, const Wire& wire,
               double speed);

// ---- simulate_measure.cpp: effect and cost of the effects, measured in this run ----

struct Measured {
    // One entry for each effect that concerns the sensor, in the order of Choice::decisions, with all of them active:
    std::vector<double> share_N;  // largest change that it made to a channel
    // For each effect, in a run of the scene's first samples with the chosen effects: the change of the force (by the
    // sensor's gains) if the effect is removed, or added if it was not chosen; fx fy fz, the largest value. NaN if
    // the gains do not determine a force.
    std::vector<std::array<double, 3>> force_N;
    std::uint64_t force_samples = 0;
    std::vector<double> time_ns;     // time per sample
    double linear_ns = 0;            // the linear model's time per sample, in the same run
    double none_ns = 0, all_ns = 0;  // time per sample without effects, with all
    double chosen_ns = 0;            // time per sample with the chosen ones
    double difference_N = 0;         // largest |chosen - all| over all channels and samples of both
    std::uint64_t samples = 0;       // number of compared samples of the scene
};
// setup; runs the whole scene twice, and parts of it again for the times
Measured measure(const sim::Scene& scene, const std::string& effects, std::size_t sensor);

// ---- simulate_timeline.cpp: the chosen effects over time, from a run of the whole scene ----

struct Timeline {
    struct Named {
        double begin_s, end_s;
        std::string kind;
    };
    struct Row {
        const sim::Decision* decision;
        std::vector<std::pair<double, double>> active_s;  // intervals in which it is on: the scene without its rests
        // Begin and end of each interval in which it changed a channel by more than a hundredth of the wanted
        // accuracy. An effect on the time of samples: always.
        std::vector<std::pair<double, double>> changed_s;
        double largest_N;  // largest change of a channel
    };
    struct Lane {  // motion of the body
        std::string name, unit;
        std::vector<double> value;  // evenly spaced over the scene
    };
    double length_s = 0;
    std::vector<Named> motions;  // consecutive motions of one kind are merged
    std::vector<Lane> lanes;     // only lanes that change
    sim::Choice choice;
    std::vector<Row> rows;  // in the order of their first change; effects that are off are last
    Timeline() = default;
    Timeline(const Timeline&) = delete;  // rows point into the choice
    Timeline(Timeline&&) = default;
};
Timeline timeline(const sim::Scene& scene, const std::string& effects, std::size_t sensor);

// simulate_figure.cpp
Figure timeline_figure(const sim::Scene& scene, const std::string& effects, std::size_t sensor);

// ---- simulate_report.cpp, simulate_text.cpp ----

struct Report {
    const sim::Simulation& simulation;  // runs with the chosen effects
    std::string effects;                // the option
    std::vector<std::size_t> sensors;   // indices of the sensors
    std::vector<Measured> measured;     // for each sensor
};
std::string scene_html(const Report& report);
nlohmann::json scene_json(const Report& report);
// Returns the active effects with the reasons. The scene is not run.
std::string choice_text(const sim::Simulation& simulation, const std::vector<std::size_t>& sensors);
std::string effects_text();
nlohmann::json effects_json();

// Returns the name in `--effects`: NAME or NAME:LEVEL.
std::string name_of(const sim::Decision& decision);
const char* name_of(sim::Stage stage);
const char* name_of(sim::Model model);

}  // namespace tactiled::ctl
