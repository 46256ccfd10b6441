// Flicker noise: equal power in each decade of frequency.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

constexpr std::size_t kDecades = 5;  // corners at a twentieth of the rate and four decades below
constexpr double kMaxSds = 4;
constexpr double kMaxStep = 1.7320508075688772;  // maximum of a uniform number with standard deviation 1

// Standard deviation of a decade, in the channel's unit. The default is a tenth of the white noise.
double sd(const Setting& s, std::size_t channel) {
    if (!std::isnan(s.p[0])) return s.p[0] * s.sensor.per_N[channel];
    if (s.sensor.model == Model::hair) return 5.14e-7;
    return 3e-5 * s.sensor.full_scale_N * s.sensor.per_N[channel];
}

std::array<double, kDecades> keeps() {
    std::array<double, kDecades> keep;
    double corner = 6.283185307179586 / 20;
    for (double& a : keep) {
        a = std::exp(-corner);
        corner /= 10;
    }
    return keep;
}

// x = a x + (1 - a^2)^(1/2) u in each decade, limited to four standard deviations. 0 at the start, when the zero was
// taken.
class FlickerNoise final : public Effect {
public:
    explicit FlickerNoise(const Setting& s) : random_(s.random), channels_(s.sensor.n()), keep_(keeps()) {
        for (std::size_t k = 0; k < channels_; ++k) sd_[k] = sd(s, k);
        for (std::size_t i = 0; i < kDecades; ++i) step_[i] = std::sqrt(1 - keep_[i] * keep_[i]) * kMaxStep / 2048;
    }
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < channels_; ++k)
            for (std::size_t n = 0; n < block.n; ++n) {
                const std::uint64_t bits = random_.bits(block.first + n, k);
                double sum = 0;
                for (std::size_t i = 0; i < kDecades; ++i) {
                    const double u = double(std::int64_t(bits >> (12 * i) & 0xfff)) - 2047.5;
                    x_[k][i] = std::clamp(keep_[i] * x_[k][i] + step_[i] * u, -kMaxSds, kMaxSds);
                    sum += x_[k][i];
                }
                block.channel[k][n] += sd_[k] * sum;
            }
    }

private:
    Stream random_;
    std::size_t channels_;
    std::array<double, kDecades> keep_, step_{};
    Channels sd_{};
    std::array<std::array<double, kDecades>, kMaxSensorChannels> x_{};
};

// Each decade is limited; decades that are slow against the scene have not reached their limit.
Bound bound(const Setting& s) {
    double sum = 0;
    for (const double a : keeps())
        sum += std::min(kMaxSds, kMaxStep * std::sqrt(1 - a * a) * std::min(double(s.samples), 1 / (1 - a)));
    Channels change{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) change[k] = sum * sd(s, k);
    const double change_N = s.sensor.largest_N(change);
    return {.change_N = change_N, .own_N = change_N};
}

const EffectEntry entry{
    .name = "flicker_noise",
    .title = "flicker noise, 1/f",
    .equation = "r = r + sum over decades of x_i, x_i = a_i x_i + sigma (1 - a_i^2)^(1/2) u",
    .source = "Hooge 1969; first-order processes a decade apart",
    .stage = Stage::converter,
    .cost_class = "c2",
    .instructions = 1200,
    .models = kAll,
    .parameters = {{"deviation_N", "one standard deviation of each decade; by default by the sensor's model", kByModel, 0,
                    100}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<FlickerNoise>(s); }};

}  // namespace
}  // namespace tactiled::sim
