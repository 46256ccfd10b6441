// The joint domain of a calibration: the distance of a reading from the calibration's rows, all channels together.
//
// The range of each channel leaves room for combinations that no load causes: one channel that is dead, has lost gain or is
// exchanged with another one stays within its range while the other channels move. The distance of a reading is d = |W
// (channel - mean)|, where W is the inverse Cholesky factor of the covariance of the calibration's rows
// (fit/joint_domain_fit.cpp). For channels that are a curved function of the load the calibration also has a curved domain,
// with a separate distance and limit (curved_distance.hpp). This check serves every model and method.
#pragma once
#include <memory>
#include <string>

#include "decoupling/decoupler.hpp"

namespace tactiled {

// Passes each reading to `inner`. An estimate whose reading is outside the joint domain becomes UNCERTAIN with
// TACTILED_OUTSIDE_DOMAIN, and its standard deviations are multiplied by d / limit, the larger one of both domains. A
// reading with a missing channel has no distance. Returns `inner` itself if the calibration has no joint domain. setup
std::unique_ptr<Decoupler> with_joint_domain(const Calibration& calibration, std::unique_ptr<Decoupler> inner);

// Returns the distance of a reading from the joint domain, which the calibration must have. setup
double joint_distance(const JointDomain& domain, std::span<const double> channel);

// Returns the fault of the calibration's joint domain, "" if there is none. setup
std::string fault_of_joint_domain(const Calibration& calibration);

}  // namespace tactiled
