// Groups of rows that are held out together, because rows of one group resemble each other.
#pragma once
#include <string>
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

inline constexpr double kSameLoad = 0.01;  // labels of one load differ by no more than this, relative to full scale

struct Groups {
    std::vector<std::size_t> of_row;
    std::vector<std::string> names;
    std::string validation;  // "leave one session out (2 sessions)"
    bool are_sessions = false;
    bool are_loads = false;
    bool are_in_time = false;  // a group is estimated from those before it alone; the first is not held out

    // Returns true if the fit that estimates `group` uses this row.
    [[nodiscard]] bool fits(std::size_t row, std::size_t group) const {
        return are_in_time ? of_row[row] < group : of_row[row] != group;
    }
};

// Returns the ways to hold rows out: sessions if there are several, else poses if the rows repeat them and stretches of
// time; the last third of the time; at the end single loads, for a recording without another way. A method with memory is
// never held out by poses or loads, because its estimate of a row depends on the rows before.
std::vector<Groups> ways_to_hold_out(const Labelled& labelled, const Rows& rows, bool remembers);

// Returns the number of each row's load, from 0 on. Rows have the same load if they are consecutive in the file and
// every label is within 1 % of full scale of that of the first row.
std::vector<std::size_t> loads_of(const Rows& rows);

// Returns the component whose labels are not spanned by the rows that estimate group `group`, so that the held-out error
// would be an extrapolation; "" = all are spanned.
std::string not_spanned_without(const Rows& rows, const Groups& groups, std::size_t group);

}  // namespace tactiled
