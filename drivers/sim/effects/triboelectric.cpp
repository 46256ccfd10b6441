// Triboelectric charge: cable and film rub while the load moves, which the piezo film's amplifier picks up.
#include <cmath>

#include "drivers/sim/effects/band_noise.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

constexpr double kMemory_s = 0.1;

double scale_N(const Sensor& sensor) { return sensor.full_scale_N / 20; }

// Noise times the movement of the load within the last tenth of a second, relative to 1/20 of full scale, at most 1.
std::unique_ptr<Effect> make(const Setting& s) {
    const std::size_t film = s.sensor.find("Vp");
    return each_film_reading(
        s, [sd_V = s.p[0] * s.sensor.per_N[film], scale_N = scale_N(s.sensor),
            approach = -std::expm1(-1 / (s.rate_Hz * kMemory_s)), noise = BandNoise(s.random, s.rate_Hz, s.p[1]),
            slow = std::array<double, 3>{}](double v, std::size_t, const Block& block, std::size_t n) mutable {
            double moved = 0;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                moved += std::abs(block.drive[axis][n] - slow[axis]);
                slow[axis] += approach * (block.drive[axis][n] - slow[axis]);
            }
            return v + sd_V * std::min(moved / scale_N, 1.0) * noise.at(block.first + n, 0);
        });
}

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

const EffectEntry entry{.name = "triboelectric",
                        .title = "triboelectric charge",
                        .equation = "v = v + sigma n(t) min(1, |F - F slow| / F0)",
                        .source = "charge by rubbing cables; magnitude assumed",
                        .stage = Stage::transducer,
                        .instructions = 70,
                        .models = kCapacitive,
                        .parameters = {{"deviation_N", "one standard deviation while the load moves", 0.02, 0, 10},
                                       {"frequency_Hz", "highest", 20, 1e-3, 1e5}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
