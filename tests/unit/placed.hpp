// Records of samples for tests: all of the sd is the calibration's, and the sensor errs like no other.
#pragma once
#include <array>

#include "tactiled/layout.h"

namespace tactiled {

inline tactiled_budget unrelated_budget(const std::array<double, 6>& sd) {
    tactiled_budget budget{};
    for (std::size_t c = 0; c < 6; ++c) budget.sd_part[TACTILED_OF_CALIBRATION][c] = float(sd[c]);
    return budget;
}

inline tactiled_placed placed(const tactiled_sample& s) {
    const std::array<double, 6> sd{s.sd_force_N[0],   s.sd_force_N[1],   s.sd_force_N[2],
                                   s.sd_torque_Nm[0], s.sd_torque_Nm[1], s.sd_torque_Nm[2]};
    return {.sample = s, .cop_sd_m = {}, .budget = unrelated_budget(sd)};
}

}  // namespace tactiled
