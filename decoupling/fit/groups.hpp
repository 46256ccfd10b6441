// Groups of rows that are held out together, since rows of one group resemble each other.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

struct Groups {
    std::vector<std::size_t> of_row;
    std::vector<std::string> names;
    std::string validation;  // "leave one session out (2 sessions)"
    bool are_sessions = false;
    bool are_loads = false;
};

// The ways to hold rows out, the one that says most about the error in use first: sessions where there are several, else
// poses where the rows repeat them, stretches of time, single loads. A method that remembers is held out by sessions
// or stretches alone: its estimate of a row depends on the rows before.
std::vector<Groups> ways_to_hold_out(const Labelled& labelled, const Rows& rows, bool remembers);

// Rows of one load, one after the other in the file: every label within 1 % of full scale of that of the first row. The
// number of each row's load, from 0 on.
std::vector<std::size_t> loads_of(const Rows& rows);

// The component whose labels are not spanned by the rows without group `group`, so that the error of the rows left out is
// one of extrapolation; "" = all are spanned.
std::string not_spanned_without(const Rows& rows, const Groups& groups, std::size_t group);

}  // namespace tactiled
