// Nonlinearity of a quarter bridge: its output is x / (4 + 2 x) and is scaled as if it were x / 4.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// Applied to the change by the load only: slow changes of the resistance are balanced before.
class BridgeNonlinearity final : public Effect {
public:
    explicit BridgeNonlinearity(const Setting& s) : channels_(s.sensor.n()), zero_(s.sensor.zero) {}
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < channels_; ++k)
            for (std::size_t n = 0; n < block.n; ++n) {
                const double x = std::max(block.channel[k][n] - zero_[k], -1.0);
                block.channel[k][n] = zero_[k] + x / (1 + x / 2);
            }
    }

private:
    std::size_t channels_;
    std::array<double, kMaxSensorChannels> zero_;
};

// Both x^2 / (2 + x) and the slope 1 / (1 + x/2)^2 are largest at the most negative x.
Bound bound(const Setting& s) {
    const auto swing = largest_swing(s);
    std::array<double, kMaxSensorChannels> change{};
    double gain = 1;
    for (std::size_t k = 0; k < s.sensor.n(); ++k) {
        const double x = std::min(swing[k], 1.0);
        change[k] = std::max(x * x / (2 - x), swing[k] * swing[k] / (2 + swing[k]));
        gain = std::max(gain, 1 / ((1 - x / 2) * (1 - x / 2)));
    }
    return {.change_N = s.sensor.largest_N(change), .gain = gain};
}

const EffectEntry entry{
    .name = "bridge_nonlinearity",
    .title = "nonlinearity of a quarter bridge",
    .equation = "r = x / (1 + x / 2)",
    .source = "Wheatstone; 0.12 % for the hairs, 1.4 % for the table at full scale",
    .stage = Stage::transducer,
    .cost_class = "c1",
    .instructions = 150,
    .models = kTable | kHair,
    .parameters = {},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<BridgeNonlinearity>(s); },
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
