// The parts of the fit of model "piezo", method "fused". decoupling/piezo/README.md says what is fitted and what a recording
// must contain.
//
// Curve, zero and leak of the film Vp: simulated from the applied press and compared with what was read, so that noise of
// a reading never becomes an input. Curve and zero of Cn: against the mean press of each of its windows. leak_tau_s,
// fusion_tau_s and window_s are kept where they are stated. The fit is refused where the press never changes fast or is
// never held, because gain and leak are one number then.
#pragma once
#include <span>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// What a film shows of a drive q at times t_s (not falling), 0 before: charge.hpp, a step at a time; and how that changes
// with the logarithm of the leak's time constant.
struct FilmResponse {
    std::vector<double> v, dv_dlog_tau;
};
FilmResponse film_response(std::span<const double> t_s, std::span<const double> q, double tau_s);

// Rows that follow each other in time without a gap.
struct PiezoRun {
    std::vector<double> t_s, press_N, Vp, Cn;
};
// Cn where the converter had a new value, with the mean over the window that ended there of the press and of its square.
struct CentreReading {
    double mean_N, mean_square_N2, Cn;
};
// s between rows, on average. setup
double row_interval_s(const std::vector<PiezoRun>& runs);
// s between the new values of a reading that repeats its last one in between. setup: throws Undetermined
double conversion_interval_s(const std::vector<PiezoRun>& runs);
std::vector<CentreReading> centre_readings(const std::vector<PiezoRun>& runs, double window_s);

// Zero, curve and window of Cn, into the calibration. setup: throws Undetermined
void fit_centre(const std::vector<PiezoRun>& runs, double range_N, std::size_t Cn, Calibration& calibration);

// Splits at another session, at a clock that goes back and at a break. setup: throws Undetermined
std::vector<PiezoRun> piezo_runs(const Rows& rows, std::size_t Vp, std::size_t Cn);

}  // namespace tactiled
