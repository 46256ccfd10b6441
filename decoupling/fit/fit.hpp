// Calibrations from labelled rows: fit, hold out, say how good. May allocate; never in the loop.
#pragma once
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "decoupling/fit/labelled.hpp"
#include "decoupling/fit/least_squares.hpp"

namespace tactiled {

struct FitRequest {
    std::string model;   // "generic", "table"
    std::string method;  // "" = the model's first
    std::string serial, contact_model = "unknown", channel_unit = "unknown";
    std::string date;  // YYYY-MM-DD
};

struct ComponentReport {
    std::string name;         // of kComponentNames
    int rows = 0;             // with this label and all channels
    double full_scale = 0;    // greatest |label|, N or Nm
    double spread = 0;        // standard deviation of the label
    double fitted_rms = 0;    // of the rows that made the calibration
    double held_out_rms = 0;  // of rows that a fit without their group had not seen; NaN = could not be validated
};

struct FitReport {
    Calibration calibration;
    std::vector<ComponentReport> components;
    int rows_read = 0;
    int rows_without_label = 0;
    int rows_missing_channel = 0;  // labelled, but a channel that is used has no value
    std::vector<std::string> warnings;
};

// Fits, then validates by leaving out each session, or where there is only one, each of five stretches of time: rows of
// one stretch resemble each other so much that rows drawn at random would praise themselves. What is held out goes
// through the Decoupler of the loop.
// setup: throws SetupError where the request is wrong, Undetermined where the data do not determine the model
FitReport fit(const Labelled& labelled, const FitRequest& request);

// ---- one function a model: a calibration from `rows`, which have every channel and at least one label of `components`
// each. Fills matrix or parameters, zero and condition of `calibration`, whose model, channels and components are set;
// may say something in `warnings`. setup: throws Undetermined
using Rows = std::vector<const LabelledRow*>;
using FitModel = void (*)(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);
void fit_generic(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);
void fit_table(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings);

}  // namespace tactiled
