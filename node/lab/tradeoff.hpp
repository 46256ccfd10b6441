// The parts of `tactilectl tradeoff`, one file each.
#pragma once
#include <array>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "decoupling/fit/labelled.hpp"
#include "drivers/sim/scene.hpp"

namespace tactiled::ctl {

// ---- tradeoff_rows.cpp: readings of the sensors in a scene, and the applied loads ----

inline constexpr std::size_t kMaxOfScene = 30'000;  // number of samples that are judged

// Returns the scene's first sensor with all effects, at most `max` of its samples. A lost frame gives no row, a
// channel without a value is NaN. The labels are the applied load. setup: throws SetupError
Labelled rows_of(const sim::Scene& scene, std::size_t max);

// The [calibrate] table of a scene, as config/scenes/README.md has it.
struct CalibrationScene {
    sim::Scene scene;
    std::string model, influence;  // its path
    std::vector<std::string> components, channels;
    std::map<std::string, double> known;
    double settle_s, from_s;
};
CalibrationScene read_calibration_scene(const std::string& path);  // setup: throws SetupError

// Returns its rows as a calibration bench records them: settled, with the chosen channels and labels, evenly thinned
// to `max`.
Labelled calibration_rows(const CalibrationScene& scene, std::size_t max);

// ---- tradeoff_plan.cpp: the methods, their calibrations and the scenes ----

struct Candidate {
    std::string model, method;
    std::string name;  // the method, and if it occurs twice, its calibration
    Calibration calibration;
    [[nodiscard]] std::unique_ptr<Decoupler> make() const;  // setup: throws SetupError
};
inline constexpr const char* kDamaged = "damaged";  // the trial that is not part of "all": its errors are unbounded
struct Trial {
    std::string kind;  // "easy", "combined", "eccentric", "dynamic", kDamaged, or the name of a file
    Labelled rows;
    std::vector<double> delay_s = {};  // known one of each channel of `rows`
};
Trial trial_of(const std::string& kind, const std::string& scene);  // setup: throws SetupError
struct Contest {                                                    // the methods of one model, and their trials
    std::string model;
    std::vector<Candidate> candidates;
    std::vector<Trial> trials;
    std::vector<std::string> refused;  // methods that could not be calibrated, with the reason
};

// Returns all models, calibrated in process on scenes of `folder` and tested there. Calls `show` with the share that
// is done.
// setup: throws SetupError
std::vector<Contest> all_contests(const std::string& folder, const std::function<void(double)>& show,
                                  const std::string& model = "");  // "" = all
// Returns the methods of the model of a scene's first sensor, calibrated as in all_contests() but on that sensor.
Contest contest_of_scene(const std::string& folder, const std::string& scene);
// Returns all methods for which a calibration has a fit.
Contest contest_of_calibration(const std::string& calibration);

// Returns the folder config/scenes of this program: beside it, or the installed one. setup: throws SetupError if it
// is missing
std::string scenes_folder();

// ---- tradeoff_judge.cpp: errors ----

struct Judged {
    // Errors of samples that are not BAD, after a tare before the first load, % of full scale; NaN = not measured or
    // no sample.
    Wrench rms_percent = kUnseen, p99_percent = kUnseen;
    double force_rms_percent = kNaN;  // over the force axes that the method measures
    double good_rms_percent = kNaN;   // over GOOD samples only
    std::size_t samples = 0, good = 0, uncertain = 0, bad = 0;
    // GOOD, but with an error of more than 5 of its own standard deviations in some component
    std::size_t undetected = 0;
};
// Returns the index of the first row under load, or the number of rows if there is none.
std::size_t first_load(const Labelled& rows);
// `delay_s`: known delay of each channel of `rows`, part of the standard deviation as in the loop (decoupling/latency.hpp);
// empty = none.
Judged judge(Decoupler& decoupler, const Candidate& candidate, const Labelled& rows,
             const std::vector<double>& delay_s = {});
// Returns those of the candidate's channels, in the order of its calibration.
std::vector<double> delays_of(const Candidate& candidate, const Labelled& rows, const std::vector<double>& delay_s);
// Returns one row over the trials of a whole sensor. Errors are geometric means, so that no trial dominates, and NaN
// if a trial had no value at all, because a method that is always BAD is not accurate. p99 is the worst trial's;
// shares are over all samples together.
Judged over_all(const std::vector<Judged>& trials);

// ---- tradeoff_time.cpp: times ----

// Returns each channel of a trial's rows in the candidate's order. setup: throws SetupError where one is missing
std::vector<Reading> readings_of(const Candidate& candidate, const Labelled& rows, std::vector<double>& storage);

struct Timing {
    std::vector<float> ns;       // time of each timed sample, without the time of the clock
    double instructions = kNaN;  // per sample, in user space; NaN = the kernel does not count them
};
// Times the candidates alternately, so that a disturbance affects all of them.
std::vector<Timing> time_all(const std::vector<Candidate>& candidates, const Labelled& rows, std::size_t samples);
double clock_ns();                  // time of one reading of the clock, median of this run
std::string why_no_instructions();  // "" if they are counted
double quantile(std::vector<float>& values, double share);

// ---- tradeoff_front.cpp: the best methods for their time, and a sentence about them ----

struct Offer {
    std::string name;
    double time_us, error_percent;  // NaN = unknown: never on the front
    double bad_percent = 0;         // share of samples without a value
};

// Returns the Pareto front: the indices of the offers for which no other is better in one of the two without being worse in
// the other, the fastest first. The first of equal offers is taken.
std::vector<std::size_t> front(const std::vector<Offer>& offers);

// Returns "table: linear from 0.05 us a sample (2.1 % rms of full scale); map from 1.5 us (0.6 %)." The list has the
// offers of the front that are better than the one before by 5 % or more, each with its share of samples without a
// value, if any.
std::string front_sentence(const std::string& model, const std::vector<Offer>& offers);

// ---- tradeoff_text.cpp, tradeoff_figure.cpp ----

struct Measure {  // one candidate in one trial; its last one is over all but kDamaged
    std::string trial;
    Judged judged;
    double p50_ns, p99_ns, p99_9_ns, instructions;
    bool on_front = false;
};
struct Result {
    const Contest* contest;
    std::vector<std::vector<Measure>> measures;  // [candidate][trial, then all]
    std::string sentence;
};
std::string tradeoff_text(const std::vector<Result>& results);
std::string tradeoff_csv(const std::vector<Result>& results);
std::string tradeoff_json(const std::vector<Result>& results);
std::string tradeoff_svg(const std::vector<Result>& results);

}  // namespace tactiled::ctl
