// The common part of the methods of model "capacitive", and the wiring of the electrodes for model "piezo". See README.md.
#pragma once
#include <memory>
#include <string>

#include "decoupling/capacitive/electrodes.hpp"
#include "decoupling/method.hpp"
#include "decoupling/solve/checked.hpp"

namespace tactiled {

// Returns the channel of each electrode. Channels other than C1 .. C4, Cn and Vp, and a repeated channel, are a
// fault. setup
Wiring electrode_wiring(const Calibration& calibration, std::string& fault);
// Returns the same for model "capacitive", where components other than fx fy fz are a fault, too. setup
Wiring pad_wiring(const Calibration& calibration, std::string& fault);

inline std::uint32_t channels_of(const Wiring& wiring) noexcept {
    std::uint32_t mask = 0;
    for (const int k : wiring)
        if (k >= 0) mask |= 1u << k;
    return mask;
}

// Returns the channels (bit k) of the pair along fx or fy (c = 0, 1) and of Cn; of Cn alone for fz. rt: wait-free
inline std::uint32_t pair_and_centre(const Wiring& wiring, std::size_t c) noexcept {
    std::uint32_t mask = 0;
    for (const std::size_t e : {2 * c, 2 * c + 1, kCentre})
        if (e < kElectrodes && (e == kCentre || c < 2) && wiring[e] >= 0) mask |= 1u << wiring[e];
    return mask;
}

// Returns the capacitance at rest that depends on the pad, zero minus stray (kStrayParameters), for each electrode.
// All five must be wired. setup
std::array<double, kElectrodes> active_at_rest(const CalibrationData& data, const Wiring& wiring, std::string& fault);

inline constexpr std::array<Parameter, kElectrodes> kStrayParameters{
    {{"stray_C1", "capacitance of C1 that does not depend on the gap, in channel_unit", -1e12, 1e12},
     {"stray_C2", "capacitance of C2 that does not depend on the gap, in channel_unit", -1e12, 1e12},
     {"stray_C3", "capacitance of C3 that does not depend on the gap, in channel_unit", -1e12, 1e12},
     {"stray_C4", "capacitance of C4 that does not depend on the gap, in channel_unit", -1e12, 1e12},
     {"stray_Cn", "capacitance of Cn that does not depend on the gap, in channel_unit", -1e12, 1e12}}};
inline constexpr std::array<Parameter, 3> kPadParameters{
    {{"normal_stiffness_N", "apparent modulus of the pad times its area, N", 1e-6, 1e9},
     {"stiffening", "exponent of the compression law, 0 = neo-Hookean", -2, 1, 0},
     {"shear_gap_exponent", "how shear stiffness rises as the gap closes, 1 = G A / gap", -5, 5, 0}}};

// Last step of ratio and overlap: a state beyond the limits of any pad is limited and flagged.
// rt: wait-free
inline double within(double value, double min, double max, bool& cut) noexcept {
    const double inside = value < min ? min : value > max ? max : value;
    cut = cut || inside != value;  // a NaN is kept and makes the estimate BAD
    return inside;
}

}  // namespace tactiled
