// Quantisation: a converter has whole steps only.
#include "drivers/sim/effects/quantisation.hpp"

#include <cmath>

namespace tactiled::sim {
namespace {

double step(const Setting& s, std::size_t channel) {
    return std::isnan(s.p[0]) ? converter_step(s.sensor, channel) : s.p[0] * s.sensor.per_N[channel];
}

class Quantisation final : public Effect {
public:
    explicit Quantisation(const Setting& s) : channels_(s.sensor.n()) {
        for (std::size_t k = 0; k < channels_; ++k) step_[k] = step(s, k);
    }
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < channels_; ++k) {
            if (step_[k] <= 0) continue;
            for (std::size_t n = 0; n < block.n; ++n)
                block.channel[k][n] = std::floor(block.channel[k][n] / step_[k] + 0.5) * step_[k];
        }
    }

private:
    std::size_t channels_;
    Channels step_{};
};

Bound bound(const Setting& s) {
    Channels change{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) change[k] = step(s, k) / 2;
    const double half_N = s.sensor.largest_N(change) * 1.000001;  // the rounding of the division
    return {.change_N = half_N, .jump_N = 2 * half_N, .own_N = half_N};
}

const EffectEntry entry{
    .name = "quantisation",
    .title = "steps of the converter",
    .equation = "r = step floor(r / step + 1/2)",
    .source = "12 bit of a table's, 16 of a hair's, AD7746 4 aF, 10 bit of 5 V for the film",
    .stage = Stage::converter,
    .cost_class = "c1",
    .instructions = 210,
    .models = kAll,
    .parameters = {{"step_N", "by default by the sensor's model", kByModel, 0, 1e3}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<Quantisation>(s); },
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
