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
std::unique_ptr<Effect> make(const Setting& s) {
    const std::array<double, kDecades> keep = keeps();
    std::array<double, kDecades> step{};
    for (std::size_t i = 0; i < kDecades; ++i) step[i] = std::sqrt(1 - keep[i] * keep[i]) * kMaxStep / 2048;
    return each_reading(s, [random = s.random, keep, step, sd = per_channel(s, [&](std::size_t k) { return sd(s, k); }),
                            x = std::array<std::array<double, kDecades>, kMaxSensorChannels>{}](
                               double r, std::size_t k, const Block& block, std::size_t n) mutable {
        const std::uint64_t bits = random.bits(block.first + n, k);
        double sum = 0;
        for (std::size_t i = 0; i < kDecades; ++i) {
            const double u = double(std::int64_t(bits >> (12 * i) & 0xfff)) - 2047.5;
            x[k][i] = std::clamp(keep[i] * x[k][i] + step[i] * u, -kMaxSds, kMaxSds);
            sum += x[k][i];
        }
        return r + sd[k] * sum;
    });
}

// Each decade is limited; decades that are slow against the scene have not reached their limit.
Bound bound(const Setting& s) {
    double sum = 0;
    for (const double a : keeps())
        sum += std::min(kMaxSds, kMaxStep * std::sqrt(1 - a * a) * std::min(double(s.samples), 1 / (1 - a)));
    return bound_of_own(s, per_channel(s, [&](std::size_t k) { return sum * sd(s, k); }));
}

const EffectEntry entry{
    .name = "flicker_noise",
    .title = "flicker noise, 1/f",
    .equation = "r = r + sum over decades of x_i, x_i = a_i x_i + sigma (1 - a_i^2)^(1/2) u",
    .source = "Hooge 1969; first-order processes a decade apart",
    .stage = Stage::converter,
    .instructions = 1200,
    .parameters = {{"deviation_N", "one standard deviation of each decade; by default by the sensor's model", kByModel, 0,
                    100}},
    .bound = bound,
    .make = make};

}  // namespace
}  // namespace tactiled::sim
