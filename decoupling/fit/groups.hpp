// Groups of rows that are held out together, because rows of one group resemble each other.
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

// Returns the ways to hold rows out, the best predictor of the error in use first: sessions if there are several, else poses
// if the rows repeat them, stretches of time, single loads. A method with memory is held out by sessions or stretches only,
// because its estimate of a row depends on the rows before.
std::vector<Groups> ways_to_hold_out(const Labelled& labelled, const Rows& rows, bool remembers);

// Returns the number of each row's load, from 0 on. Rows have the same load if they are consecutive in the file and
// every label is within 1 % of full scale of that of the first row.
std::vector<std::size_t> loads_of(const Rows& rows);

// Returns the component whose labels are not spanned by the rows without group `group`, so that the held-out error would be
// an extrapolation; "" = all are spanned.
std::string not_spanned_without(const Rows& rows, const Groups& groups, std::size_t group);

}  // namespace tactiled
