// The error of a calibration on rows that it has not seen.
#pragma once
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Returns estimated minus applied, for one row; NaN where either is unknown. A model with memory starts again.
Wrench error_of(Decoupler& decoupler, const LabelledRow& row);

// Returns the root mean square over rows, per component.
Wrench rms_error(const Calibration& calibration, const Rows& rows);

// Sets the domain of the calibration: the minimum and maximum of each channel.
void set_domain(const Rows& rows, Calibration& calibration);

// Fits `method` to `rows`. If the method takes a zero drift and `drift` (sd of each channel's zero, empty = none) has
// some, each row occurs several times, each time with other random zeros. setup: throws Undetermined
void fit_with_drift(const FitEntry& method, const Rows& rows, const std::vector<double>& drift, Calibration& calibration,
                    std::vector<std::string>& warnings);

// Returns the mean error of the calibration over the rows of a session whose load is below LoadPeak::kRest, for each session
// with three of them or more.
std::map<std::size_t, Wrench> errors_at_rest(const Calibration& calibration, const Rows& rows);

struct Validation {
    std::string how;                 // "leave one session out (2 sessions)"; "" = not possible
    Rows all;                        // every row; the number of their loads says how well the fit is determined
    std::vector<HeldOut> rows;       // each once
    std::vector<std::size_t> group;  // group of each of `rows`
    std::vector<bool> has_sd;        // false: the method states no standard deviation for such a reading
    bool by_sessions = false;        // each group is a session
    // Mean error at rest of each session, by the fit of all rows, which a tare subtracts; empty = unknown.
    std::map<std::size_t, Wrench> at_rest;
    // The same rows with random zeros, if the user states a drift: the standard deviation then holds for these.
    std::vector<HeldOut> drifted;
    Wrench rms = kUnseen;
    Wrench rms_of_part = kUnseen;  // for the method that this one adds to, fitted to the same parts
};
// Leaves each group of rows out in turn and fits the others, or those before it. A method with memory reads the whole
// recording in order, each session from its start, as in the loop: held-out rows are then estimated with their actual past,
// and without their labels. No fit sees the rows `unused`; they are estimated with the others.
struct FitToValidate {
    const Labelled& labelled;
    const Rows& rows;
    const FitEntry& method;
    const Calibration& whole;  // with the domain, full scales and widths of all rows
    const ZeroDrift& drift;
    const std::set<const LabelledRow*>* unused = nullptr;
};
// Returns the error relative to full scale, as a mean over the components; NaN: one has none.
double mean_share(const Wrench& error, const Calibration& calibration);
// Returns the validation in the first of ways_to_hold_out() in which every part is determined.
Validation hold_out(const FitToValidate& of);
// Returns the validations in all ways, the largest error first, because the next hour may differ as the worst part did. Adds
// the ways to `tried`.
std::vector<Validation> hold_out_all_ways(const FitToValidate& of, std::vector<Way>& tried,
                                          std::vector<std::string>& warnings);

// Sets sd, sd_slope, sd_load and sd_unloading of each component from its held-out errors, as error_shape.hpp says, times
// Student's factor for few loads. Rows of one load count together as one. All of this also holds after a tare, which
// subtracts `at_rest` (without a stated drift of the zeros). Rows without `has_sd` do not count. Sets none if a component
// has fewer than eight held-out rows. `takes_unloading`: sets sd_unloading, too.
void set_uncertainty(const Validation& validation, Calibration& calibration, bool takes_unloading);

std::array<std::array<double, 6>, 6> crosstalk(const std::vector<HeldOut>& rows, const Calibration& calibration);

}  // namespace tactiled
