// The error of a calibration on rows that it has not seen.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Estimated minus applied, of one row; NaN where either is unknown. A model that remembers starts anew.
Wrench error_of(Decoupler& decoupler, const LabelledRow& row);

// Root mean square over rows, per component.
Wrench rms_error(const Calibration& calibration, const Rows& rows);

// The least and the greatest of each channel, into the calibration: its domain.
void set_domain(const Rows& rows, Calibration& calibration);

// `method` fitted to `rows`. Where it takes a zero drift and `drift` (sd of each channel's zero, empty = none) has some,
// each row is there several times, each time with other random zeros. setup: throws Undetermined
void fit_with_drift(const FitEntry& method, const Rows& rows, const std::vector<double>& drift, Calibration& calibration,
                    std::vector<std::string>& warnings);

struct Validation {
    std::string how;                 // "leave one session out (2 sessions)"; "" = could not be
    std::vector<HeldOut> rows;       // each once
    std::vector<std::size_t> group;  // of each of `rows`
    bool by_sessions = false;        // a group is a session
    // The same rows with random zeros, where the user states a drift: the standard deviation holds for these.
    std::vector<HeldOut> drifted;
    Wrench rms = kUnseen;
    Wrench rms_of_part = kUnseen;  // of the method that this one adds to, fitted to the same parts
};
// Leaves each group of rows out in turn and fits the rest, in the first of ways_to_hold_out() in which every rest determines
// the model. A method that remembers reads the whole recording in order, each session from its start, as its loop does: to
// what is held out it comes with the past that it would have had, of which it has seen no label.
Validation hold_out(const Labelled& labelled, const Rows& rows, const FitEntry& method, const Calibration& calibration,
                    const ZeroDrift& drift, std::vector<std::string>& warnings);

// sd and sd_slope of each component from its held-out errors: the greatest of their 68.27 % quantile, their 95 % quantile
// over 1.96 and, from 200 rows on, their 99 % quantile over 2.58; at least the root mean square of the worst session; times
// Student's factor for few loads. None where a component has fewer than eight held-out rows.
void set_uncertainty(const Validation& validation, Calibration& calibration);

std::array<std::array<double, 6>, 6> crosstalk(const std::vector<HeldOut>& rows, const Calibration& calibration);

}  // namespace tactiled
