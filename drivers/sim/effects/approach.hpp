// A quantity that starts with the scene and approaches its end value p[0] exponentially with the time constant p[1]:
// moisture, self-heating.
#pragma once
#include <array>
#include <cmath>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

using PerUnit = std::array<double, kMaxSensorChannels>;  // change of each channel per unit of the quantity

// x' = (p[0] - x) / p[1], exact.
class Approach final : public Effect {
public:
    Approach(const Setting& s, const PerUnit& per_unit)
        : channels_(s.sensor.n()), end_(s.p[0]), step_(-std::expm1(-1 / (s.rate_Hz * s.p[1]))), per_unit_(per_unit) {}
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n) {
            for (std::size_t k = 0; k < channels_; ++k) block.channel[k][n] += per_unit_[k] * now_;
            now_ += step_ * (end_ - now_);
        }
    }

private:
    std::size_t channels_;
    double end_, step_, now_ = 0;
    PerUnit per_unit_;
};

// The bound is exact: the value at the last sample; the rate is highest at the beginning.
inline Bound approach_bound(const Setting& s, PerUnit per_unit) {
    const double reached = -std::expm1(-(double(s.samples) + 1) / (s.rate_Hz * s.p[1]));
    for (double& change : per_unit) change *= std::abs(s.p[0]) * reached;
    const double change_N = s.sensor.largest_N(per_unit);
    return {.change_N = change_N, .own_N = change_N, .own_rate_N_s = change_N / reached / s.p[1]};
}

}  // namespace tactiled::sim
