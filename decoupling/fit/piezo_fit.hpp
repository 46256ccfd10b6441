// The common parts of the fit of model "piezo", method "fused". decoupling/piezo/README.md lists the fitted
// parameters and the requirements on a recording.
//
// Curve, zero and leak of the film Vp are fitted by simulating Vp from the applied press, so that noise of a reading
// never becomes an input. Curve and zero of Cn are fitted to the mean press in each of its windows. leak_tau_s,
// fusion_tau_s and window_s are kept if they are stated. The fit is refused if the press never changes fast or is
// never held, because gain and leak cannot be separated then.
#pragma once
#include <span>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Returns the signal of a film for a drive q at times t_s (not decreasing), 0 before: charge.hpp, step by step; and
// its derivative by the logarithm of the leak's time constant.
struct FilmResponse {
    std::vector<double> v, dv_dlog_tau;
};
FilmResponse film_response(std::span<const double> t_s, std::span<const double> q, double tau_s);

// Rows that follow each other in time without a gap.
struct PiezoRun {
    std::vector<double> t_s, press_N, Vp, Cn;
};
// Cn at the time of a new value, with the means of the press and of its square over the window that ended then.
struct CentreReading {
    double mean_N, mean_square_N2, Cn;
};
// Returns the mean interval between rows, s. setup
double row_interval_s(const std::vector<PiezoRun>& runs);
// Returns the interval between new values of a reading that repeats its last value in between, s. setup: throws
// Undetermined
double conversion_interval_s(const std::vector<PiezoRun>& runs);
std::vector<CentreReading> centre_readings(const std::vector<PiezoRun>& runs, double window_s);

// Fits zero, curve and window of Cn and stores them in the calibration. setup: throws Undetermined
void fit_centre(const std::vector<PiezoRun>& runs, double range_N, std::size_t Cn, Calibration& calibration);

// Splits at a new session, at a clock that goes back and at a gap. setup: throws Undetermined
std::vector<PiezoRun> piezo_runs(const Rows& rows, std::size_t Vp, std::size_t Cn);

}  // namespace tactiled
