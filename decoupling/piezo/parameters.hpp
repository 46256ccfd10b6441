// The parameters of model "piezo", for the loop and for the fit.
#pragma once
#include <array>

#include "decoupling/solve/parameters.hpp"

namespace tactiled {

inline constexpr double kMinTau_s = 1e-3, kMaxTau_s = 1e4;

inline constexpr Parameter kLeak{"leak_tau_s", "time constant of the film with its read-out, R C, s", kMinTau_s, kMaxTau_s};
inline constexpr Parameter kFusion{
    "fusion_tau_s", "time constant of the fusion, s; at most leak_tau_s, which is the default", kMinTau_s, kMaxTau_s, 0};
inline constexpr Parameter kWindow{"window_s", "time over which the converter of Cn takes its mean, s", 1e-4, 10, 0.1};

// The fit takes these as known if they are stated.
inline constexpr std::array<Parameter, 3> kKnownOfPiezo{kLeak, kFusion, kWindow};

inline constexpr std::array<Parameter, 8> kPiezoParameters{
    {{"gain_b", "slope of the film at rest, channel_unit of Vp a N of press", 1e-12, 1e12},
     {"gain_a", "curvature of the film, channel_unit of Vp a N^2", 0, 1e12, 0},
     {"normal_b", "slope of Cn at rest, channel_unit of Cn a N of press", 1e-12, 1e12},
     {"normal_a", "curvature of Cn, channel_unit of Cn a N^2", -1e12, 1e12, 0},
     {"normal_range_N", "press up to which both were measured, N", 1e-9, 1e9},
     kLeak,
     kFusion,
     kWindow}};

}  // namespace tactiled
