// Reads the joint domain of a calibration file.
#pragma once
#include "config/calibration.hpp"
#include "config/options.hpp"

namespace tactiled {

// Sets `calibration.joint_domain` from the keys joint_domain.*, if there are any; the channels are known. Errors go to the
// problems of `file`. setup
void read_joint_domain(Options& file, Calibration& calibration);

}  // namespace tactiled
