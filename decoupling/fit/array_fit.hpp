// Calibrates an array of taxels from presses with a known total force, at known places or not: zero and gain of each taxel,
// and the matrix that all share. README.md of decoupling/patch has the equations.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/array_presses.hpp"

namespace tactiled {

struct TaxelReport {
    enum class State { good, weak, strong, dead, unloaded } state = State::good;
    double gain = 1, gain_sd = 0;  // gain_sd is a part of the gain
    double load_N = 0;             // largest force in a step
    int presses = 0;               // in which it was in contact or beside it
    double noise_N = 0;            // sd at rest, along the normal
};

struct ArrayReport {
    Calibration calibration;
    std::vector<TaxelReport> taxels;
    TaxelPlaces places;
    std::size_t presses = 0, steps = 0;
    int rest_rows = 0, loaded_rows = 0, left_out = 0;
    bool matrix_is_fitted = false;
    double gain_spread = 0;                                       // sd of the gains of one kind, without far ones
    double gain_sd = 0;                                           // median of those of the taxels
    double force_error = 0, place_error_m = 0;                    // beyond the noise: relative; NaN without places
    double held_out_rms_N = 0, within_1_sd = 0, beyond_5_sd = 0;  // forces of presses that were left out
    double held_out_ratio = 1;  // rms of their errors over the predicted sd; includes places
    std::vector<std::string> warnings;
};

// setup: throws SetupError where the recording is wrong, Undetermined where it does not determine the model
ArrayReport fit_array(const ArrayRequest& request);

// One row for each taxel: taxel,x_mm,y_mm,z_mm,state,gain,gain_sd,load_N,presses,noise_N.
std::string taxel_csv(const ArrayReport& report);
const char* text_of(TaxelReport::State state);

}  // namespace tactiled
