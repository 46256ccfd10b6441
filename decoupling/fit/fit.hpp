// Makes calibrations from labelled rows: fit, hold out, report the accuracy. May allocate; never called in the loop.
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
    std::string method;  // "" = the model's first; "auto" = all, sorted by their held-out error
    std::string serial, contact_model = "unknown", channel_unit = "unknown";
    std::string date;                               // YYYY-MM-DD
    std::map<std::string, double> parameters = {};  // stated parameters, for the methods that read them: area_m2, gap ...
    std::map<std::string, Fit> start = {};          // by method: the required input, such as an influence map
    // Zeros of the channels: found = one per session if the recording shows that the sessions differ.
    enum class Zeros { found, per_session, common } zeros = Zeros::found;
    // sd of each channel's zero in use, relative to its width; none: from the sessions
    std::optional<double> zero_drift = {};
    bool keep_outliers = false;  // suspected labels are named and kept
    Temperature dummy = {};      // from take_dummy(); its name is empty if the sensor has none
    // A reading of a channel at or beyond these is at its saturation limit; its row is not used.
    double saturates_below = -std::numeric_limits<double>::infinity();
    double saturates_above = std::numeric_limits<double>::infinity();
};

struct ComponentReport {
    std::string name;         // one of kComponentNames
    int rows = 0;             // rows with this label and all channels
    double full_scale = 0;    // largest |label|, N or Nm
    double spread = 0;        // standard deviation of the label
    double fitted_rms = 0;    // root mean square on the fitted rows
    double held_out_rms = 0;  // on rows that were held out with their group; NaN = validation was not possible
};

struct HeldOut {
    const LabelledRow* row;
    Wrench estimated_S;
};

struct MethodReport {
    std::string method;
    std::vector<double> held_out_rms;  // one per component, as in ComponentReport
    std::string refused;               // the reason why it could not be fitted, "" = it was
    double seconds = 0;                // for the fit and its validation
};

// A way to hold rows out. refused: why it was not possible, "" = it was
struct Way {
    std::string how;      // the text of Calibration::validation
    double error = kNaN;  // relative to full scale, as a mean over the components
    std::string refused;
};

// A label that the method cannot explain although it explains the rows around it.
struct Suspect {
    const LabelledRow* row;
    std::size_t component;   // the component with the largest disagreement
    double label, expected;  // N or Nm; `expected` is the estimate without this row
    bool left_out;           // false: it is used, because its load cannot be distinguished from a nonlinearity
};

// sd of each channel's zero in use; empty: none.
struct ZeroDrift {
    std::vector<double> sd;  // channel_unit
    bool stated = false;     // stated by the user; else from the sessions, whose held-out errors contain it already
};

// The zeros of the channels in each session, relative to their mean over the sessions.
struct SessionZeros {
    std::vector<std::vector<double>> offset;  // [session][channel], channel_unit; empty: unknown
    std::vector<double> sd;                   // one per channel, over the sessions, without the scatter of the estimate
    bool own = false;                         // each session is read from its own zero, as after a tare
    // 68 % quantiles for an affine map, leaving sessions out; relative to full scale
    double error = 0, error_with_own = 0;
};

struct FitReport {
    Calibration calibration;
    std::shared_ptr<const Labelled> labelled;  // the rows used; held_out points to them
    std::vector<ComponentReport> components;
    std::vector<MethodReport> methods;  // the methods tried
    std::vector<HeldOut> held_out;      // from the calibration's own method
    std::vector<Suspect> suspects;      // in the order of the file
    SessionZeros zeros;
    bool drift_measured = false;  // false: no session has times over a minute, so that a drift of the zero would not show
    // The ways to hold rows out; `held_out` is from the one with the largest error, and each component has the error and the
    // standard deviation of the way in which its own is largest.
    std::vector<Way> ways;
    // Slope of the estimated component [i] over the applied one [j] on held-out rows, both relative to full scale, by
    // least squares over all applied components: perfect would be 1 on the diagonal and 0 elsewhere. NaN where
    // unknown.
    std::array<std::array<double, 6>, 6> crosstalk{};
    int rows_read = 0;
    int rows_without_label = 0;
    int rows_missing_channel = 0;  // labelled, but a channel that is used has no value
    int rows_saturated = 0;        // labelled, but a channel that is used is at its saturation limit
    std::vector<std::string> warnings;
};

// Facts about the dummy of a recording that its rows do not show.
struct DummyStated {
    double at_C = kNaN;          // temperature of the recording; NaN = the mean of its column temperature_C
    double difference_K = kNaN;  // largest difference of temperature between the dummy and a channel
};

// Makes the dummy of the model (TemperatureEffect::dummy), if the rows have it, the temperature of the rows, and none of
// their channels. Returns its scale for FitRequest::dummy, without a name if there is none. temperature_fit.cpp
// setup: throws SetupError where a stated fact is missing, has no dummy, or the unit is not that of the coefficients
Temperature take_dummy(Labelled& labelled, const std::string& model, const std::string& channel_unit,
                       const DummyStated& stated);

// Fits, names labels that seem wrong, and validates by leaving out each session, or with one session each pose and each of
// five stretches of time, and then the last third of the time: rows of one group resemble each other so much that random
// rows would give a too small error. Single loads are left out if the rest would not determine the model.
// Held-out rows are estimated by the Decoupler of the loop. Parts are fitted in parallel, which does not change the
// result.
// setup: throws SetupError where the request is wrong, Undetermined where the data do not determine the model.
FitReport fit(const Labelled& labelled, const FitRequest& request);

// ---- One function per method: it makes a calibration from `rows`, which have every channel and at least one label
// of `components` each. It fills matrix, parameters, tables, zero and condition of `calibration`, whose model,
// method, channels, components and domain are set. Held-out rows are not among `rows`: a method must not use
// coefficients of another call, but may keep a ridge that another call has stored in `calibration`, and a width or centres,
// which come from the channels alone. It may add texts to `warnings`.
// setup: throws Undetermined
using Rows = std::vector<const LabelledRow*>;
using FitModel = void (*)(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

// An option of `tactilectl calibrate` that sets the start values of a fit.
struct FitOption {
    const char *name = nullptr, *help = "";  // "influence" for --influence; nullptr: there is none
    // Stores the meaning of `value` in the fit. setup: throws SetupError
    void (*put)(const std::string& value, Fit& start) = nullptr;
};

struct ArrayRequest;
struct ArrayReport;

// One fit, at the end of its own file. The list works as that of the methods (decoupling/method.hpp).
// The channels that a fit knows by their names.
struct KnownChannels {
    bool (*includes)(std::string_view name) = nullptr;  // nullptr: any channel
    std::string_view description = {};                  // describes one, for messages
    const char* unit = "unknown";                       // the usual one
};

struct FitEntry {
    std::string_view model = {}, method = {};
    FitModel fit = nullptr;
    KnownChannels channels = {};
    // True if the estimate of a row depends on the rows before. fit() then removes no suspected row or pose from between
    // other rows, and estimates held-out rows together with the rows before them.
    bool remembers = false;
    std::string_view adds_to = {};  // the method to which this one adds a correction that should lower its error
    bool must_gain = false;         // refused if the held-out error is not lower than that of `adds_to`
    bool takes_zero_drift = false;  // repeating rows with random zeros gives the best fit for such zeros
    FitOption option = {};
    // In place of `fit`: calibrates an array from its own kind of recording (array_fit.hpp).
    ArrayReport (*array)(const ArrayRequest& request) = nullptr;
    Registry<FitEntry> in_list{this};
};

// Returns the fit of that name, nullptr if there is none. setup
const FitEntry* find_fit(std::string_view model, std::string_view method);
// Returns the fit of an array of that model, nullptr if it is no array. setup
const FitEntry* find_array_fit(std::string_view model);
// Returns the fits of one model, if it has channels, in the order of its methods; the first is the default. all_fits(): of
// all models, these in alphabetical order. setup
std::vector<const FitEntry*> fits_of(std::string_view model);
std::vector<const FitEntry*> all_fits();
// Returns the fault of the list: two fits of one name, or a fit without a method; "" if there is none. Checked by fit().
// setup
std::string fault_of_fits();
// Sets an option in each fit of the request's model that has an option of this name. setup: throws SetupError
void put_fit_option(std::string_view name, const std::string& value, FitRequest& request);

// Returns the stated parameters that a fit accepts. setup: throws Undetermined where one is outside its range
CalibrationData known_beforehand(const Calibration& calibration, std::span<const Parameter> parameters);

// Fits each component as an affine function of the channels: matrix and zero. `forget`: row i of N has the weight
// forget^(N - i).
// setup: throws Undetermined
void fit_affine(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings,
                std::optional<double> forget = {});

inline constexpr std::size_t kRowsPerCoefficient = 3;  // with fewer rows the residual describes the noise

// Returns the rows of a matrix as a table of a calibration.
std::vector<std::vector<double>> rows_in(const Eigen::MatrixXd& matrix);

// Returns the number of independent rows with a label of component `c`: consecutive rows under the same load count as
// one.
std::size_t independent_rows(const Rows& rows, std::size_t c);

}  // namespace tactiled
