// Zero by temperature: gauges and pads at rest change with the room's temperature.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/warmth.hpp"

namespace tactiled::sim {
namespace {

class TemperatureZero final : public Effect {
public:
    explicit TemperatureZero(const Setting& s) : channels_(s.sensor.n()) {
        for (std::size_t k = 0; k < channels_; ++k) per_K_[k] = drift_per_K(s, s.p[0], s.p[1], k);
    }
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < channels_; ++k)
            for (std::size_t n = 0; n < block.n; ++n) block.channel[k][n] += per_K_[k] * block.ambient_K[n];
    }

private:
    std::size_t channels_;
    std::array<double, kMaxSensorChannels> per_K_{};
};

Bound bound(const Setting& s) {
    std::array<double, kMaxSensorChannels> change{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) change[k] = drift_per_K(s, s.p[0], s.p[1], k) * s.extent.ambient_K;
    const double change_N = s.sensor.largest_N(change);
    const double rate_N_s = s.extent.ambient_K > 0 ? change_N / s.extent.ambient_K * s.extent.ambient_rate_K_s : 0;
    return {.change_N = change_N, .own_N = change_N, .own_rate_N_s = rate_N_s};
}

const EffectEntry entry{
    .name = "temperature_zero",
    .title = "zero by temperature",
    .equation = "r = r + alpha_k dT",
    .source = "handbook values of Ni-Cr, platinum, silicone",
    .stage = Stage::transducer,
    .cost_class = "c0",
    .instructions = 70,
    .models = kAll,
    .parameters = {{"per_K", "of R0 or C0; by default by the sensor's model", std::numeric_limits<double>::quiet_NaN(), -0.1,
                    0.1},
                   {"mismatch", "standard deviation between channels, relative", 0.01, 0, 1}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<TemperatureZero>(s); },
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
