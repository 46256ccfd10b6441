// Triboelectric charge: cable and film rub while the load moves, which the piezo film's amplifier picks up.
#include <cmath>

#include "drivers/sim/effects/band_noise.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

constexpr double kMemory_s = 0.1;

double scale_N(const Sensor& sensor) { return sensor.full_scale_N / 20; }

// Noise times the movement of the load within the last tenth of a second, relative to 1/20 of full scale, at most 1.
class Triboelectric final : public Effect {
public:
    explicit Triboelectric(const Setting& s)
        : film_(s.sensor.find("Vp")),
          has_film_(film_ < s.sensor.n()),
          sd_V_(has_film_ ? s.p[0] * s.sensor.per_N[film_] : 0),
          scale_N_(scale_N(s.sensor)),
          approach_(-std::expm1(-1 / (s.rate_Hz * kMemory_s))),
          noise_(s.random, s.rate_Hz, s.p[1]) {}
    void apply(Block& block) noexcept override {
        if (!has_film_) return;
        for (std::size_t n = 0; n < block.n; ++n) {
            double moved = 0;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                moved += std::abs(block.drive[axis][n] - slow_[axis]);
                slow_[axis] += approach_ * (block.drive[axis][n] - slow_[axis]);
            }
            block.channel[film_][n] += sd_V_ * std::min(moved / scale_N_, 1.0) * noise_.at(block.first + n, 0);
        }
    }

private:
    std::size_t film_;
    bool has_film_;
    double sd_V_, scale_N_, approach_;
    BandNoise noise_;
    std::array<double, 3> slow_{};
};

// A load differs from its mean over the memory by at most the mean of its changes; an error of the load counts twice.
Bound bound(const Setting& s) {
    if (s.sensor.find("Vp") >= s.sensor.n()) return {};
    double moved = 0, by_error = 0;
    for (const Axis axis : {kFx, kFy, kFz}) {
        for (int i = 0; i < 40; ++i)
            moved += (std::exp(-i) - std::exp(-i - 1)) * change(s, axis, (i + 1) * kMemory_s + 1 / s.rate_Hz);
        by_error += 2 * load_of_error(s.sensor, axis);
    }
    const double max_N = s.p[0] * BandNoise(s.random, s.rate_Hz, s.p[1]).max(s.samples, 0);
    const double change_N = max_N * std::min(moved / scale_N(s.sensor), 1.0);
    return {.change_N = change_N, .gain = 1 + max_N * by_error / scale_N(s.sensor), .own_N = change_N};
}

const EffectEntry entry{
    .name = "triboelectric",
    .title = "triboelectric charge",
    .equation = "v = v + sigma n(t) min(1, |F - F slow| / F0)",
    .source = "charge by rubbing cables; magnitude assumed",
    .stage = Stage::transducer,
    .cost_class = "c1",
    .instructions = 70,
    .models = kCapacitive,
    .parameters = {{"deviation_N", "one standard deviation while the load moves", 0.02, 0, 10},
                   {"frequency_Hz", "highest", 20, 1e-3, 1e5}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<Triboelectric>(s); }};

}  // namespace
}  // namespace tactiled::sim
