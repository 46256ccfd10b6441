// The monitor of a calibration: can a load cause this reading, all channels together?
//
// The range of each channel leaves room for combinations that no load causes: a channel that is dead, has lost gain or is
// exchanged with another one stays within its range while the others move. The monitor (config/calibration.hpp, made by
// fit/monitor_fit.cpp) has two distances, each with a limit from rows that were held out: of the scores t, the leading
// principal components, from the rows (Hotelling's T^2), and of the residual e, what is left of the channels after the
// scores and their products, from zero (Q). The products describe channels that are a curved function of the load. The
// squared limit of e grows with t as the variance of a predicted value does, because few rows have large scores. With as
// many scores as channels there is no residual. Serves every model and method.
#pragma once
#include <memory>
#include <span>
#include <string>

#include "decoupling/decoupler.hpp"

namespace tactiled {

class MonitorDistance {
public:
    // The calibration has a monitor. setup
    explicit MonitorDistance(const Monitor& monitor);

    // Returns the larger of both squared distances, each relative to its squared limit: above 1 the reading is outside. NaN
    // or infinite for numbers that are not finite or overflow. rt: bounded by the channels and the scores
    [[nodiscard]] double squared(const double* channel) const noexcept;

private:
    std::size_t n_, n_scores_, n_residuals_, n_products_;
    std::size_t rows_, product_rows_;  // padded
    double per_limit_, per_residual_limit_, per_feature_;
    // One block, in the order of its use: mean, columns of scores and residuals, mean of the products, columns of minus
    // their coefficients and of their whitening.
    std::vector<double> block_;
};

// Passes each reading to `inner`. An estimate whose reading is outside becomes UNCERTAIN with TACTILED_OUTSIDE_DOMAIN, and
// its standard deviations are multiplied by distance / limit. A reading with a missing channel has no distance. Returns
// `inner` itself if the calibration has no monitor. setup
std::unique_ptr<Decoupler> with_monitor(const Calibration& calibration, std::unique_ptr<Decoupler> inner);

// Returns the fault of the calibration's monitor, "" if there is none. setup
std::string fault_of_monitor(const Calibration& calibration);

}  // namespace tactiled
