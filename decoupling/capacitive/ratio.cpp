// Model "capacitive", method "ratio": the gap cancels in (C1 - C2) / Cn. Cn minus its stray part gives the closeness
// u = d0 / d. Each pair gives the shift, independent of the gap:
//
//     (C1 - C2) / Cn = (A1 - A2) / An,    A1 - A2 = 4 R dx sin(opening / 2) + O(dx^3)
//
// in units of the length over which one electrode would double. `active` are capacitances minus stray capacitances.
#include "decoupling/capacitive/methods.hpp"
#include "decoupling/capacitive/pad.hpp"

namespace tactiled {
namespace {

class Ratio final : public CheckedModel {
public:
    Ratio(const Calibration& calibration, const Wiring& wiring, const std::array<double, kElectrodes>& active, PadLaw pad)
        : CheckedModel(calibration, channels_of(wiring), ~0u), wiring_(wiring), active_(active), pad_(pad) {
        for (std::size_t e = 0; e < kElectrodes; ++e) channel_[e] = std::size_t(wiring[e]);
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "ratio"; }
    [[nodiscard]] std::uint32_t timed_by(std::size_t c) const noexcept override { return pair_and_centre(wiring_, c); }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        bool cut = false;
        const double centre = active_[kCentre];
        const double v = within(input.r[channel_[kCentre]] / centre, kMinCloseness - 1, kMaxCloseness - 1, cut);
        // The change of the ratio since rest, divided by its change per unit of shift; differences are taken first.
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

    Wiring wiring_;
    std::array<double, kElectrodes> active_;
    std::array<std::size_t, kElectrodes> channel_{};
    PadLaw pad_;
};

constexpr auto kParameters = joined(
    joined(kStrayParameters, kPadParameters),
    std::array<Parameter, 1>{
        {{"shear_scale_N", "shear force at which one electrode would double and its opposite vanish, N", 1e-9, 1e9}}});

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    const Wiring wiring = pad_wiring(data.calibration(), fault);
    if (!fault.empty()) return nullptr;
    const auto active = active_at_rest(data, wiring, fault);
    if (!fault.empty()) return nullptr;
    return std::make_unique<Ratio>(
        data.calibration(), wiring, active,
        PadLaw{data["normal_stiffness_N"], data["stiffening"], data["shear_scale_N"], data["shear_gap_exponent"], 0});
}

const MethodEntry entry{.model = "capacitive", .method = "ratio", .place = 20, .parameters = kParameters, .make = make};

}  // namespace
}  // namespace tactiled
