// Humidity: carriers swell and permittivities rise while a skin takes up the air's moisture.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// Change of channel k by 1 % of relative humidity, its unit. Polyimide swells by 9e-6 per percent; moist air, board and
// cable add 1e-4 of the capacitance.
double per_percent(const Setting& s, std::size_t k) {
    if (s.sensor.channels[k] == "Vp") return 0;
    if (s.sensor.model == Model::table) return (std::isnan(s.p[2]) ? 9e-6 : s.p[2]) * s.sensor.table.gauge_factor_tangential;
    return (std::isnan(s.p[2]) ? 1e-4 : s.p[2]) * s.sensor.zero[k];
}

// The air changes at the scene's beginning and the skin follows.
class Humidity final : public Effect {
public:
    explicit Humidity(const Setting& s)
        : channels_(s.sensor.n()), percent_(s.p[0]), approach_(-std::expm1(-1 / (s.rate_Hz * s.p[1]))) {
        for (std::size_t k = 0; k < channels_; ++k) per_percent_[k] = per_percent(s, k);
    }
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n) {
            for (std::size_t k = 0; k < channels_; ++k) block.channel[k][n] += per_percent_[k] * moist_;
            moist_ += approach_ * (percent_ - moist_);
        }
    }

private:
    std::size_t channels_;
    double percent_, approach_, moist_ = 0;
    std::array<double, kMostChannels> per_percent_{};
};

Bound bound(const Setting& s) {
    const double reached = -std::expm1(-(double(s.samples) + 1) / (s.rate_Hz * s.p[1])), moist = std::abs(s.p[0]) * reached;
    std::array<double, kMostChannels> change{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) change[k] = per_percent(s, k) * moist;
    const double change_N = s.sensor.largest_N(change);
    return {.change_N = change_N, .own_N = change_N, .own_rate_N_s = change_N / reached / s.p[1]};
}

}  // namespace

extern const EffectEntry humidity;
const EffectEntry humidity{
    .name = "humidity",
    .title = "humidity",
    .equation = "r = r + b_k H, H' = (change - H) / tau",
    .source = "polyimide: hygroscopic expansion of 9 ppm per percent",
    .stage = Stage::transducer,
    .cost_class = "c1",
    .instructions = 90,
    .models = kTable | kCapacitive,
    .parameters = {{"change_percent", "of the relative humidity, at the scene's beginning", 2, -100, 100},
                   {"time_s", "tau, in which the skin takes it up", 300, 0.1, 1e6},
                   {"per_percent", "strain, or of C0; by default by the sensor's model",
                    std::numeric_limits<double>::quiet_NaN(), 0, 0.01}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<Humidity>(s); }};

}  // namespace tactiled::sim
