// Self-heating: the measuring current warms the gauges once it is switched on, at the scene's beginning.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/warmth.hpp"

namespace tactiled::sim {
namespace {

// T' = (V^2 / R R_thermal - T) / tau, exact.
class SelfHeating final : public Effect {
public:
    explicit SelfHeating(const Setting& s)
        : channels_(s.sensor.n()), rise_K_(s.p[0]), approach_(-std::expm1(-1 / (s.rate_Hz * s.p[1]))) {
        for (std::size_t k = 0; k < channels_; ++k) per_K_[k] = drift_per_K(s, s.p[2], s.p[3], k);
    }
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n) {
            for (std::size_t k = 0; k < channels_; ++k) block.channel[k][n] += per_K_[k] * warmer_K_;
            warmer_K_ += approach_ * (rise_K_ - warmer_K_);
        }
    }

private:
    std::size_t channels_;
    double rise_K_, approach_, warmer_K_ = 0;
    std::array<double, kMostChannels> per_K_{};
};

Bound bound(const Setting& s) {
    const double reached = -std::expm1(-(double(s.samples) + 1) / (s.rate_Hz * s.p[1])), warmer_K = s.p[0] * reached;
    std::array<double, kMostChannels> change{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) change[k] = drift_per_K(s, s.p[2], s.p[3], k) * warmer_K;
    const double change_N = s.sensor.largest_N(change);
    return {.change_N = change_N, .own_N = change_N, .own_rate_N_s = change_N / reached / s.p[1]};
}

}  // namespace

extern const EffectEntry self_heating;
const EffectEntry self_heating{
    .name = "self_heating",
    .title = "self-heating of the gauges",
    .equation = "r = r + alpha_k T, T' = (V^2 / R R_thermal - T) / tau",
    .source = "Joule's heat through one thermal resistance",
    .stage = Stage::transducer,
    .cost_class = "c1",
    .instructions = 90,
    .models = kTable | kHair,
    .parameters = {{"rise_K", "in the end: V^2 / R times the thermal resistance", 0.1, 0, 100},
                   {"time_s", "tau", 20, 1e-3, 1e5},
                   {"per_K", "of R0; by default by the sensor's model", std::numeric_limits<double>::quiet_NaN(), -0.1, 0.1},
                   {"mismatch", "deviation between channels, relative", 0.01, 0, 1}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<SelfHeating>(s); }};

}  // namespace tactiled::sim
