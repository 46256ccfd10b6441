// The film's amplifier: a low pass of its series resistance and capacitance, and saturation limits.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

double keep(const Setting& s) { return std::exp(-6.283185307179586 * s.p[0] / s.rate_Hz); }

std::unique_ptr<Effect> make(const Setting& s) {
    const std::size_t film = s.sensor.find("Vp");
    return each_film_reading(s, [keep = keep(s), saturation_V = s.p[1], zero_V = s.sensor.zero[film], state_V = 0.0,
                                 started = false](double v, std::size_t) mutable {
        if (!started) state_V = v;
        started = true;
        state_V += (1 - keep) * (v - state_V);
        return std::clamp(state_V, zero_V - saturation_V, zero_V + saturation_V);
    });
}

// A sample that is j samples old has the weight (1 - a) a^j; the part beyond the saturation limit is lost. The leak
// of the film is far slower.
Bound bound(const Setting& s) {
    const std::size_t channel = s.sensor.find("Vp");
    if (channel >= s.sensor.n()) return {};
    const double a = keep(s), step_s = 1 / s.rate_Hz;
    const auto older = [&](double age_s) { return std::pow(a, std::floor(age_s / step_s + 1e-9) + 1); };
    const double time_s = 1 / (6.283185307179586 * s.p[0]);
    const double low_pass_N = lag_N(s, 16 * time_s + 4 * step_s, older);
    Channels beyond{};
    beyond[channel] = std::max(largest_swing(s)[channel] - s.p[1], 0.0);
    return {.change_N = low_pass_N + s.sensor.largest_N(beyond)};
}

const EffectEntry entry{
    .name = "piezo_amplifier",
    .title = "amplifier of the piezo film",
    .equation = "v' = 2 pi f_c (u - v), clipped at the saturation limits",
    .source = "charge amplifier: 1 / (1 + s R_s C_p)",
    .stage = Stage::converter,
    .instructions = 30,
    .models = kCapacitive,
    .parameters = {{"corner_Hz", "of the low pass", 1000, 1e-3, 1e7}, {"rail_V", "on both sides of the zero", 5, 1e-3, 100}},
    .bound = bound,
    .make = make};

}  // namespace
}  // namespace tactiled::sim
