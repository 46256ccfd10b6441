// Integral nonlinearity of a converter: its characteristic is curved.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

constexpr double kToOne = 2.598076211353316;  // 27^(1/2) / 2: u (1 - u^2) is largest at u = 3^(-1/2)

// r + INL * range * c (u - u^3), u = (r - zero) / range: 0 at both ends and in the middle.
class ConverterNonlinearity final : public Effect {
public:
    explicit ConverterNonlinearity(const Setting& s)
        : channels_(s.sensor.n()), zero_(s.sensor.zero), amount_(s.p[0] * kToOne) {
        for (std::size_t k = 0; k < channels_; ++k) range_[k] = half_range(s.sensor, k);
    }
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < channels_; ++k) {
            const double per_range = range_[k] > 0 ? 1 / range_[k] : 0, amount = amount_ * range_[k];
            for (std::size_t n = 0; n < block.n; ++n) {
                const double u = std::clamp((block.channel[k][n] - zero_[k]) * per_range, -1.0, 1.0);
                block.channel[k][n] += amount * u * (1 - u * u);
            }
        }
    }

private:
    std::size_t channels_;
    std::array<double, kMaxSensorChannels> zero_;
    double amount_;
    Channels range_{};
};

// The slope is between 1 - 2 c INL and 1 + c INL.
Bound bound(const Setting& s) {
    Channels change = largest_swing(s);
    for (std::size_t k = 0; k < s.sensor.n(); ++k) {
        const double inl = std::abs(s.p[0]) * half_range(s.sensor, k);
        change[k] = std::min(std::abs(s.p[0]) * kToOne * change[k], inl);
    }
    return {.change_N = s.sensor.largest_N(change), .gain = 1 + 2 * kToOne * std::abs(s.p[0])};
}

const EffectEntry entry{
    .name = "converter_nonlinearity",
    .title = "nonlinearity of the converter",
    .equation = "r = r + INL range 2.598 (u - u^3), u = (r - zero) / range",
    .source = "derived; data sheets of 12 bit converters: 1 to 2 steps of 4096",
    .stage = Stage::converter,
    .cost_class = "c1",
    .instructions = 180,
    .models = kAll,
    .parameters = {{"inl", "largest error, of the range", 4e-4, -0.1, 0.1}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<ConverterNonlinearity>(s); },
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
