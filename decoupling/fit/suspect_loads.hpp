// The loads whose errors stand out from those of all loads and of the loads around them.
#pragma once
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Rows of one and the same label, one after the other.
struct Load {
    Rows rows;
    Wrench label{}, error{}, estimate{};  // error and estimate: medians over the rows
    std::vector<double> channel;          // means, in widths
};

// In the order of sessions and times. setup
std::vector<Load> loads_of_same_label(const Rows& rows);

// Fills the estimates and errors of the loads. setup
void estimate_loads(const Calibration& calibration, std::vector<Load>& loads);

// The judgement of each load, in the order of the loads.
struct Found {
    std::vector<bool> suspected;  // its error stands out, and the loads around do not share it
    std::vector<bool> stays;      // not left out: its error stands out by little, or its load is at the end of the range
    std::vector<std::size_t> component;  // that disagrees most
    std::size_t bent = 0;                // loads whose error stands out but is that of the loads around
};

// `components`: of a wrench, at least one; `full_scale`: of their labels. setup
Found suspects_of(const std::vector<Load>& loads, const std::vector<std::size_t>& components, const Wrench& full_scale);

// The middle of the values, or the one at a share of 0 .. 1; the median of none is NaN. setup
double median(std::vector<double> values);
double quantile(std::vector<double> values, double share);

}  // namespace tactiled
