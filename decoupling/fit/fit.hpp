// Calibrations from labelled rows: fit, hold out, say how good. May allocate; never in the loop.
#pragma once
#include <array>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/calibration.hpp"
#include "config/registry.hpp"
#include "decoupling/fit/labelled.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/solve/parameters.hpp"

namespace tactiled {

struct FitRequest {
    std::string model;   // "generic", "table"
    std::string method;  // "" = the model's first; "auto" = all, the most accurate on held-out rows first
    std::string serial, contact_model = "unknown", channel_unit = "unknown";
    std::string date;                               // YYYY-MM-DD
    std::map<std::string, double> parameters = {};  // known beforehand, for the methods that look for them: area_m2, gap ...
    std::map<std::string, Fit> start = {};          // by method: what it must be given, such as a map of influences
    // Zero of the channels: found = one for each session where that is what the recording shows.
    enum class Zeros { found, per_session, common } zeros = Zeros::found;
    std::optional<double> zero_drift = {};  // sd of each channel's zero in use, as a part of its width; none: the sessions'
    bool keep_outliers = false;             // labels that look wrong are named, and stay
    // A reading of a channel at or beyond these is at its saturation limit; its row stays out.
    double saturates_below = -std::numeric_limits<double>::infinity();
    double saturates_above = std::numeric_limits<double>::infinity();
};

struct ComponentReport {
    std::string name;         // of kComponentNames
    int rows = 0;             // with this label and all channels
    double full_scale = 0;    // greatest |label|, N or Nm
    double spread = 0;        // standard deviation of the label
    double fitted_rms = 0;    // of the rows that made the calibration
    double held_out_rms = 0;  // of rows that a fit without their group had not seen; NaN = could not be validated
};

// A row that the fit had not seen, and what it made of it.
struct HeldOut {
    const LabelledRow* row;
    Wrench estimated_S;
};

struct MethodReport {
    std::string method;
    std::vector<double> held_out_rms;  // a component, as in ComponentReport
    std::string refused;               // why it could not be fitted, "" = it was
    double seconds = 0;                // for the fit and its validation
};

// A label that the method cannot explain although it explains the rows around it.
struct Suspect {
    const LabelledRow* row;
    std::size_t component;   // the one that disagrees most
    double label, expected;  // N or Nm; `expected` is what the channels say without this row
    bool left_out;           // false: it is part of the calibration, since its load cannot be told from a bend
};

// sd of each channel's zero in use; empty: none.
struct ZeroDrift {
    std::vector<double> sd;  // channel_unit
    bool stated = false;     // by the user; else of the sessions, whose held-out errors have it already
};

// The zeros of the channels in each session, relative to their mean over the sessions.
struct SessionZeros {
    std::vector<std::vector<double>> offset;  // [session][channel], channel_unit; empty: not known
    std::vector<double> sd;                   // a channel, over the sessions, without the scatter of the estimate
    bool own = false;                         // each session is read from its own zero, as after a tare
    double error = 0, error_with_own = 0;     // 68 % quantiles for an affine map, leaving sessions out; parts of full scale
};

struct FitReport {
    Calibration calibration;
    std::shared_ptr<const Labelled> labelled;  // what was used, which held_out refers to
    std::vector<ComponentReport> components;
    std::vector<MethodReport> methods;  // those that were tried
    std::vector<HeldOut> held_out;      // of the calibration's own method
    std::vector<Suspect> suspects;      // in the order of the file
    SessionZeros zeros;
    // Slope of the estimated component [i] over the applied one [j] on held-out rows, both in full scales, by least
    // squares over all applied components: 1 on the diagonal and 0 elsewhere would be perfect. NaN where unknown.
    std::array<std::array<double, 6>, 6> crosstalk{};
    int rows_read = 0;
    int rows_without_label = 0;
    int rows_missing_channel = 0;  // labelled, but a channel that is used has no value
    int rows_saturated = 0;        // labelled, but a channel that is used is at its saturation limit
    std::vector<std::string> warnings;
};

// Fits, names labels that look wrong, and validates by leaving out each session; where there is only one, each pose or each
// of five stretches of time: rows of one group resemble each other so much that rows drawn at random would praise
// themselves. One load at a time is left out where the rest does not determine the model. Held-out rows go through the
// Decoupler of the loop. Parts are fitted in parallel; the result does not depend on that.
// setup: throws SetupError where the request is wrong, Undetermined where the data do not determine the model.
FitReport fit(const Labelled& labelled, const FitRequest& request);

// ---- one function a method: a calibration from `rows`, which have every channel and at least one label of `components`
// each. Fills matrix, parameters, tables, zero and condition of `calibration`, whose model, method, channels, components and
// domain are set; what is held out is not among `rows`, so nothing found with it may be kept. May say something in
// `warnings`.
// setup: throws Undetermined
using Rows = std::vector<const LabelledRow*>;
using FitModel = void (*)(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// An option of `tactilectl calibrate` that gives a fit the numbers from which it starts.
struct FitOption {
    const char *name = nullptr, *help = "";  // "influence" for --influence; nullptr: there is none
    // Puts what `value` stands for into the fit. setup: throws SetupError
    void (*put)(const std::string& value, Fit& start) = nullptr;
};

// One fit, at the end of its own file: the list is as that of the methods (decoupling/method.hpp).
struct FitEntry {
    std::string_view model = {}, method = {};
    FitModel fit = nullptr;
    bool (*knows_channel)(std::string_view) = nullptr;  // nullptr: any channel
    std::string_view channels = {};                     // said of the channels that it knows
    const char* channel_unit = "unknown";               // that such channels usually have
    // What it makes of a row depends on the rows before, as fit() must then respect: nothing is taken out of their midst,
    // neither a row that looks odd nor a pose, and what is held out is read with its past.
    bool remembers = false;
    std::string_view adds_to = {};  // the method to which this one adds a correction: its error is the one to be lowered
    bool must_gain = false;         // refused where the held-out error is not lower than that of `adds_to`
    bool takes_zero_drift = false;  // a fit of rows that are repeated with random zeros is the best one for such zeros
    FitOption option = {};
    Registry<FitEntry> in_list{this};
};

// nullptr where there is none of that name. setup
const FitEntry* find_fit(std::string_view model, std::string_view method);
// The fits of one model in the order of its methods: the first is taken where none is named. all_fits(): of all models,
// these in alphabetical order. setup
std::vector<const FitEntry*> fits_of(std::string_view model);
std::vector<const FitEntry*> all_fits();
// The fault of the list: two fits of one name, or a fit of no method; "" where there is none. fit() asks. setup
std::string fault_of_fits();
// For each fit of the request's model that has an option of this name. setup: throws SetupError
void put_fit_option(std::string_view name, const std::string& value, FitRequest& request);

// The parameters that a fit may be told beforehand. setup: throws Undetermined where one is outside its range
CalibrationData known_beforehand(const Calibration& calibration, std::span<const Parameter> parameters);

// Each component is an affine function of the channels: matrix and zero. `forget`: row i of N counts forget^(N - i).
// setup: throws Undetermined
void fit_affine(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings,
                std::optional<double> forget = {});

inline constexpr std::size_t kRowsPerCoefficient = 3;  // fewer describe the noise

// Rows that were recorded under the same load, one after the other, count as one: how many there are of those with a
// label of component `c`.
std::size_t independent_rows(const Rows& rows, std::size_t c);

}  // namespace tactiled
