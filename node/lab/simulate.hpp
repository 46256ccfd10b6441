// The parts of `tactilectl simulate`, one file each.
#pragma once
#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "drivers/sim/simulation.hpp"
#include "node/lab/port.hpp"
#include "node/lab/progress.hpp"

namespace tactiled::ctl {

// ---- simulate_csv.cpp: signals.csv and truth.csv ----

// Either path may be empty, or "-" for standard output. One sensor: plain columns and a row for each frame that arrives.
// Several: NAME.COLUMN and a row where any arrives. Both files have the same rows. setup: throws SetupError where a file
// cannot be created, std::runtime_error where it cannot be written
void write_csv(const sim::Scene& scene, const std::string& effects, const std::string& signals, const std::string& truth);

// ---- simulate_pty.cpp: the scene as a device ----

// One pty a sensor, in the scene's order, or one for all of them in format cobs, which names the device of each frame.
// Returns the exit status. setup: throws SetupError
int play_scene(const sim::Scene& scene, const std::string& effects, const std::vector<std::string>& ptys, const Wire& wire,
               double speed);

// ---- simulate_measure.cpp: what the effects do and cost, measured in this run ----

struct Measured {
    // One entry for each effect that concerns the sensor, in the order of Choice::decisions, with all of them active:
    std::vector<double> share_N;  // largest change that it made to a channel
    // For each, in a run of the scene's first samples with the chosen effects: by how much the force that the sensor's gains
    // make of the channels differs without it, or with it where it was not chosen; fx fy fz, the largest. NaN where the
    // gains do not determine a force.
    std::vector<std::array<double, 3>> force_N;
    std::uint64_t force_samples = 0;
    std::vector<double> time_ns;     // it took a sample
    double linear_ns = 0;            // the linear model's time a sample, in the same run
    double none_ns = 0, all_ns = 0;  // a sample without effects, with all
    double chosen_ns = 0;            // with those chosen
    double difference_N = 0;         // largest, chosen - all, over all channels and samples that both have
    std::uint64_t samples = 0;       // number of compared samples of the scene
};
// setup; runs the whole scene twice, and parts of it again against the clock
Measured measure(const sim::Scene& scene, const std::string& effects, std::size_t sensor);

// ---- simulate_timeline.cpp: what the chosen effects did when, from a run of the whole scene ----

struct Timeline {
    struct Named {
        double begin_s, end_s;
        std::string kind;
    };
    struct Row {
        const sim::Decision* decision;
        std::vector<std::pair<double, double>> active_s;  // where it is on: all of the scene but for its rests
        // Begin and end of each time in which it changed a channel by more than a hundredth of the wanted accuracy. An
        // effect on the time of samples: always.
        std::vector<std::pair<double, double>> changed_s;
        double largest_N;  // change of a channel
    };
    struct Lane {  // motion of the body
        std::string name, unit;
        std::vector<double> value;  // evenly spaced over the scene
    };
    double length_s = 0;
    std::vector<Named> motions;  // neighbours of one kind are one
    std::vector<Lane> lanes;     // only lanes that change
    sim::Choice choice;
    std::vector<Row> rows;  // in the order of their first change; those that are off, last
    Timeline() = default;
    Timeline(const Timeline&) = delete;  // rows point into the choice
    Timeline(Timeline&&) = default;
};
Timeline timeline(const sim::Scene& scene, const std::string& effects, std::size_t sensor);

// simulate_figure.cpp. An SVG that stands alone and in a page.
std::string timeline_svg(const sim::Scene& scene, const std::string& effects, std::size_t sensor);

// ---- simulate_report.cpp, simulate_text.cpp ----

struct Report {
    const sim::Simulation& simulation;  // with the chosen effects
    std::string effects;                // the option
    std::vector<std::size_t> sensors;   // their indices
    std::vector<Measured> measured;     // for each sensor
};
std::string scene_html(const Report& report);
nlohmann::json scene_json(const Report& report);
// The active effects with the reasons. The scene is not run.
std::string choice_text(const sim::Simulation& simulation, const std::vector<std::size_t>& sensors);
std::string effects_text();
nlohmann::json effects_json();

// Name in `--effects`: the effect, and its level where it has one. NAME or NAME:LEVEL.
std::string name_of(const sim::Decision& decision);
const char* name_of(sim::Stage stage);
const char* name_of(sim::Model model);

}  // namespace tactiled::ctl
