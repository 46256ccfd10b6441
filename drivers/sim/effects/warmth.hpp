// The sensors' response to temperature, shared by several effects.
#pragma once
#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

// Change of channel k at rest per 1 K, in its unit. Defaults: Ni-Cr 1e-4 /K, plus 32 ppm/K of expansion of its
// carrier relative to the gauge; platinum 3e-3 /K; a pad's gap and permittivity 5e-4 /K of the capacitance; a taxel 5e-4 /K
// of its full scale. `lane`: selects the random part, so that channels differ.
inline double drift_per_K(const Setting& s, double relative_per_K, double mismatch, std::size_t channel) {
    if (s.sensor.channels[channel] == "Vp") return 0;  // see pyroelectric
    if (std::isnan(relative_per_K))
        relative_per_K = s.sensor.model == Model::table ? 1e-4 + 32e-6 * 2 : s.sensor.model == Model::hair ? 3e-3 : 5e-4;
    const double alike = 1 + mismatch * s.sample.noise(0, channel);
    const double of = s.sensor.model == Model::capacitive ? s.sensor.zero[channel]
                      : s.sensor.model == Model::taxel    ? s.sensor.full_scale_N * s.sensor.per_N[channel]
                                                          : 1;
    return relative_per_K * alike * of;
}

// Slowest time constant of heat through a layer of polymer, L^2 / (pi^2 a), a = 1.1e-7 m^2/s: 0.92 s for 1 mm.
inline double diffusion_s(const Sensor& sensor) {
    const double depth = sensor.model == Model::table   ? 250e-6
                         : sensor.model == Model::hair  ? sensor.hair.height_m
                         : sensor.model == Model::taxel ? sensor.pitch_m
                                                        : sensor.capacitive.gap_m;
    return depth * depth / (std::numbers::pi * std::numbers::pi * 1.1e-7);
}

// Share of full contact for heat: grows with the press, with one half at a tenth of full scale.
inline double touch_scale_N(const Sensor& sensor) { return sensor.full_scale_N / 10; }
inline double touch(double press_N, double scale_N) {
    const double N = std::max(press_N, 0.0);
    return N / (N + scale_N);
}

}  // namespace tactiled::sim
