// Model "capacitive": the piezo-capacitive sensor of the thesis "Development of a Piezo-Capacitive Tactile Force Sensor for
// Measuring Static and Dynamic Forces in Minimally Invasive Robotic Surgeries": an upper electrode on a soft pad over four
// sectors C1 (+x) C2 (-x) C3 (+y) C4 (-y) and a centre Cn. decoupling/capacitive/README.md is its page.
//
//     quadratic:  curves C(F), one an electrode     (capacitive_quadratic.cpp)
//     ratio:      the gap cancels in (C1 - C2) / Cn  (here)
//     overlap:    gap and shift from all five        (capacitive_overlap.cpp)
#include "decoupling/capacitive/methods.hpp"
#include "decoupling/capacitive/pad.hpp"

namespace tactiled {
namespace {

// Method "ratio". Cn less its stray part gives closeness u = d0 / d. Each pair gives the shift, whatever the gap:
//     (C1 - C2) / Cn = (A1 - A2) / An,    A1 - A2 = 4 R dx sin(opening / 2) + O(dx^3)
// in units of the length over which one electrode would double. `active` are capacitances less stray ones.
class Ratio final : public CheckedModel {
public:
    Ratio(const Calibration& calibration, const Wiring& wiring, const std::array<double, kElectrodes>& active, PadLaw pad)
        : CheckedModel(calibration, channels_of(wiring), ~0u), active_(active), pad_(pad) {
        for (std::size_t e = 0; e < kElectrodes; ++e) channel_[e] = std::size_t(wiring[e]);
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "ratio"; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        bool cut = false;
        const double centre = active_[kCentre];
        const double v = within(input.r[channel_[kCentre]] / centre, kMinCloseness - 1, kMaxCloseness - 1, cut);
        // The change of the ratio since rest, times what the ratio changes by at one unit of shift; differences first.
        const auto shift = [&](std::size_t plus, std::size_t minus) {
            const double change =
                (input.r[channel_[plus]] - input.r[channel_[minus]]) - (active_[plus] - active_[minus]) * v;
            return within(change / ((active_[plus] + active_[minus]) * (1 + v)), -1 / kLargestShift, 1 / kLargestShift, cut);
        };
        const double shear_N = pad_.shear_stiffness_at(v);
        estimate.wrench_S[0] = shear_N * shift(0, 1);
        estimate.wrench_S[1] = shear_N * shift(2, 3);
        estimate.wrench_S[2] = 0.0 - pad_.press_N(v);
        if (cut) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY;
    }

    std::array<double, kElectrodes> active_;
    std::array<std::size_t, kElectrodes> channel_{};
    PadLaw pad_;
};

std::unique_ptr<Decoupler> make(const Calibration& calibration, const std::string& method, Options& options) {
    std::string fault = fault_of_checked(calibration);
    Wiring wiring{};
    if (fault.empty()) wiring = electrode_wiring(calibration, fault);
    for (const auto& name : calibration.components)
        if (fault.empty() && name != "fx" && name != "fy" && name != "fz")
            fault = fmt::format("component \"{}\"; a capacitive sensor sees fx fy fz", name);
    std::unique_ptr<Decoupler> made;
    if (fault.empty())
        made = method == "ratio"     ? make_capacitive_ratio(calibration, wiring, fault)
               : method == "overlap" ? make_capacitive_overlap(calibration, wiring, fault)
                                     : make_capacitive_quadratic(calibration, wiring, fault);
    if (made == nullptr) options.problem("calibration", calibration.path + ": method " + method + ": " + fault);
    return made;
}

const DecouplerEntry entry("capacitive", {"quadratic", "ratio", "overlap"}, make);

}  // namespace

std::unique_ptr<Decoupler> make_capacitive_ratio(const Calibration& calibration, const Wiring& wiring, std::string& fault) {
    std::array<Parameter, kElectrodes + 4> known;
    std::copy(kStrayParameters.begin(), kStrayParameters.end(), known.begin());
    std::copy(kPadParameters.begin(), kPadParameters.end(), known.begin() + kElectrodes);
    known.back() = {"shear_scale_N", "shear force at which one electrode would double and its opposite vanish, N", 1e-9,
                    1e9};
    std::array<double, known.size()> value;
    fault = read_parameters(calibration, known, value.data());
    if (!fault.empty()) return nullptr;
    const auto active = active_at_rest(calibration, wiring, value.data(), fault);
    if (!fault.empty()) return nullptr;
    return std::make_unique<Ratio>(calibration, wiring, active, PadLaw{value[5], value[6], value[8], value[7], 0});
}

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

std::array<double, kElectrodes> active_at_rest(const Calibration& calibration, const Wiring& wiring, const double* stray,
                                               std::string& fault) {
    std::array<double, kElectrodes> active{};
    for (std::size_t e = 0; e < kElectrodes; ++e) {
        if (wiring[e] < 0) {
            fault = fmt::format("channels lacks {}; needed are C1 C2 C3 C4 Cn", kElectrode[e].name);
            return active;
        }
        active[e] = calibration.zero[std::size_t(wiring[e])] - stray[e];
        if (!(active[e] > 0)) {
            fault = fmt::format("stray_{} = {} is not below the zero of {}, {}", kElectrode[e].name, stray[e],
                                kElectrode[e].name, calibration.zero[std::size_t(wiring[e])]);
            return active;
        }
    }
    return active;
}

}  // namespace tactiled
