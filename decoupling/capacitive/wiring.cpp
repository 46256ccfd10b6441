// The channel of each electrode, and the part of each capacitance that depends on the pad.
#include <fmt/format.h>

#include <algorithm>

#include "decoupling/capacitive/methods.hpp"
#include "decoupling/temperature.hpp"

namespace tactiled {

Wiring electrode_wiring(const Calibration& calibration, std::string& fault) {
    Wiring wiring;
    wiring.fill(-1);
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        const std::string& name = calibration.channels[k];
        if (std::find(calibration.channels.begin(), calibration.channels.begin() + std::ptrdiff_t(k), name) !=
            calibration.channels.begin() + std::ptrdiff_t(k))
            fault = fmt::format("channel \"{}\" twice", name);
        if (name == "Vp") continue;
        const std::size_t e = electrode_index(name);
        if (e == kElectrodes) {
            fault =
                fmt::format("channel \"{}\"; a capacitive sensor has C1 C2 C3 C4 Cn (and Vp, for model \"piezo\")", name);
            continue;
        }
        wiring[e] = int(k);
    }
    return wiring;
}

Wiring pad_wiring(const Calibration& calibration, std::string& fault) {
    const Wiring wiring = electrode_wiring(calibration, fault);
    for (const auto& name : calibration.components)
        if (fault.empty() && name != "fx" && name != "fy" && name != "fz")
            fault = fmt::format("component \"{}\"; a capacitive sensor measures fx fy fz", name);
    return wiring;
}

std::array<double, kElectrodes> active_at_rest(const CalibrationData& data, const Wiring& wiring, std::string& fault) {
    std::array<double, kElectrodes> active{};
    for (std::size_t e = 0; e < kElectrodes; ++e) {
        if (wiring[e] < 0) {
            fault = fmt::format("channels lacks {}; needed are C1 C2 C3 C4 Cn", kElectrode[e].name);
            return active;
        }
        const double zero = data.calibration().zero[std::size_t(wiring[e])], stray = data[kStrayParameters[e].name];
        active[e] = zero - stray;
        if (!(active[e] > 0)) {
            fault = fmt::format("stray_{} = {} is not below the zero of {}, {}", kElectrode[e].name, stray,
                                kElectrode[e].name, zero);
            return active;
        }
    }
    return active;
}

namespace {

// Silicone, handbook values of gap and permittivity together, relative to the capacitance. The modulus of rubber
// follows the absolute temperature.
const TemperatureEffect effect{.name = "capacitive", .zero_per_K = 5e-4, .channel_unit = "", .gain_per_K = 3.4e-3};

}  // namespace

}  // namespace tactiled
