// Finds the loads whose errors exceed those of all loads and of the loads around them.
#pragma once
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Consecutive rows with the same label.
struct Load {
    Rows rows;
    Wrench label{}, error{}, estimate{};  // error and estimate: medians over the rows
    std::vector<double> channel;          // means, in widths
};

// Returns the loads in the order of sessions and times. setup
std::vector<Load> loads_of_same_label(const Rows& rows);

// Fills the estimates and errors of the loads. setup
void estimate_loads(const Calibration& calibration, std::vector<Load>& loads);

// The result for each load, in the order of the loads.
struct Found {
    std::vector<bool> suspected;  // its error is large, and the loads around do not share it
    // not left out: its error exceeds the limit slightly, or its load is at the end of the range
    std::vector<bool> stays;
    std::vector<std::size_t> component;  // the component with the largest disagreement
    std::size_t bent = 0;                // number of loads with a large error that the loads around share
};

// Finds suspected loads. `components`: at least one of a wrench; `full_scale`: of their labels;
// `relevant`: smaller errors of a label are no mistake. setup
Found suspects_of(const std::vector<Load>& loads, const std::vector<std::size_t>& components, const Wrench& full_scale,
                  const Wrench& relevant);

}  // namespace tactiled
