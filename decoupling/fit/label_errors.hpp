// The errors of a fit on its loads as a mixture: right labels, whose errors have Student's distribution, and wrong labels,
// which may be off by anything in the range of the labels. One posterior for each label takes the place of limits.
#pragma once
#include <vector>

#include "decoupling/fit/fit.hpp"

namespace tactiled {

// Consecutive rows with the same label, within 1 % of full scale.
struct Load {
    Rows rows;
    Wrench label{}, error{}, estimate{};  // error and estimate: medians over the rows
    std::vector<double> channel;          // means, in widths
};

// Returns the loads in the order of sessions and times. setup
std::vector<Load> loads_of_same_label(const Rows& rows, const Wrench& full_scale);

// Fills the estimates and errors of the loads. setup
void estimate_loads(const Calibration& calibration, std::vector<Load>& loads);

// The loads whose errors a load shares: those next to it in time, and the nearest ones in the channels. Hysteresis, drift
// and the bends of a sensor are errors of this kind; an error of a label is not. By index of the loads.
struct Neighbours {
    std::vector<std::vector<std::size_t>> in_time, in_channels;
};
Neighbours neighbours_of(const std::vector<Load>& loads);

// Returns the probability of each label to be wrong: [load][component of a wrench], NaN without a label. `full_scale`: of
// the labels of each component, 0 for those without; `relevant`: an error that the neighbours do not share is no mistake up
// to this size. setup
std::vector<Wrench> wrong_labels(const std::vector<Load>& loads, const Neighbours& neighbours, const Wrench& full_scale);

// ---- The mixture of one component, for tests ----

struct ErrorMixture {
    double sd = 0;              // scale of Student's distribution for a size of 1
    double follows = 0;         // the scale of an error is sd * size^follows
    double degrees = 0;         // degrees of freedom
    double share = 0;           // share of wrong labels
    std::vector<double> wrong;  // probability of each
};

// `error`: of each load; `size`: of the errors around it, relative to that of all; `full_scale`: half of the wrong labels
// are off by more than half of it (Cauchy's distribution: a decimal point or a sign may have been lost). By expectation and
// maximisation (Lange, Little and Taylor 1989, with a second component).
ErrorMixture error_mixture(const std::vector<double>& error, const std::vector<double>& size, double full_scale);

}  // namespace tactiled
