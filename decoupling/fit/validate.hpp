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

// The group of each row, which is held out with all rows of its group: see hold_out().
std::vector<std::size_t> groups_of_rows(const Labelled& labelled, const Rows& rows, bool remembers);

struct Validation {
    std::string how;            // "leave one session out (2 sessions)"; "" = could not be
    std::vector<HeldOut> rows;  // each once
    Wrench rms = kUnseen;
};
// Leaves each session out in turn and fits the rest; with one session, each pose (rows of the same labels) where the rows
// repeat poses, else each of five stretches of time. A method that remembers is not held out by poses, and its loop reads
// the whole recording in order, each session from its start: to what is held out it comes with the past that it would
// have had, of which it has seen no label.
Validation hold_out(const Labelled& labelled, const Rows& rows, const FitEntry& method, const Calibration& calibration,
                    std::vector<std::string>& warnings);

// sd and sd_slope such that 68.27 % of the held-out errors of each component are within one standard deviation; none
// where a component has no held-out rows.
void set_uncertainty(const std::vector<HeldOut>& rows, Calibration& calibration);

std::array<std::array<double, 6>, 6> crosstalk(const std::vector<HeldOut>& rows, const Calibration& calibration);

}  // namespace tactiled
