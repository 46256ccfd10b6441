// The joint domain of a calibration: how far a reading lies from those that the calibration saw, all channels together.
//
// The range of each channel leaves room for combinations that no load causes: one channel that is dead, has lost gain or is
// exchanged with another one stays within its range while the other channels move. The distance of a reading is
// d = |W (channel - mean)|, where W is the inverse Cholesky factor of the covariance of the calibration's rows
// (fit/joint_domain_fit.cpp). For channels that are a curved function of the load the calibration also has a curved domain,
// with a distance and a limit of its own (curved_distance.hpp). This check serves every model and method.
#pragma once
#include <memory>
#include <string>

#include "decoupling/decoupler.hpp"

namespace tactiled {

// Passes each reading to `inner`, and marks an estimate whose reading lies beyond the joint domain: UNCERTAIN, with
// TACTILED_OUTSIDE_DOMAIN and its standard deviations times d / limit, the greater one of both domains. A reading of which a
// channel is missing has no distance. Without a joint domain in the calibration, `inner` itself is returned. setup
std::unique_ptr<Decoupler> with_joint_domain(const Calibration& calibration, std::unique_ptr<Decoupler> inner);

// The distance of a reading from the joint domain of the calibration, which has one. setup
double joint_distance(const JointDomain& domain, std::span<const double> channel);

// The fault of the calibration's joint domain, "" if there is none. setup
std::string fault_of_joint_domain(const Calibration& calibration);

}  // namespace tactiled
