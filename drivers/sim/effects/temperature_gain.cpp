// Gain by temperature: a warm skin is softer or stiffer, and a warm gauge responds less or more.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

double per_K(const Setting& s) {
    if (!std::isnan(s.p[0])) return s.p[0];
    return s.sensor.model == Model::table ? 5e-4 : -2e-3;  // polyimide gets softer, rubber stiffer
}

class TemperatureGain final : public Effect {
public:
    explicit TemperatureGain(const Setting& s) : per_K_(per_K(s)), channels_(s.sensor.n()), zero_(s.sensor.zero) {}
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < channels_; ++k)
            for (std::size_t n = 0; n < block.n; ++n)
                block.channel[k][n] += per_K_ * block.ambient_K[n] * (block.channel[k][n] - zero_[k]);
    }

private:
    double per_K_;
    std::size_t channels_;
    std::array<double, kMaxSensorChannels> zero_;
};

Bound bound(const Setting& s) {
    const double part = std::abs(per_K(s)) * s.extent.ambient_K;
    std::array<double, kMaxSensorChannels> change = largest_swing(s);
    for (double& c : change) c *= part;
    const double change_N = s.sensor.largest_N(change);
    return {.change_N = change_N, .gain = 1 + part, .own_N = change_N};
}

const EffectEntry entry{
    .name = "temperature_gain",
    .title = "gain by temperature",
    .equation = "r = zero + (1 + beta dT) (r - zero)",
    .source = "handbook values; rubber's modulus goes with the absolute temperature",
    .stage = Stage::transducer,
    .cost_class = "c0",
    .instructions = 100,
    .models = kAll,
    .parameters = {{"per_K", "relative; by default by the sensor's model", std::numeric_limits<double>::quiet_NaN(), -0.05,
                    0.05}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<TemperatureGain>(s); },
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
