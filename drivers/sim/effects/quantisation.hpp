// The step of a sensor's converter.
#pragma once
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {

// Step in the channel's unit. Strain gauges: the configured bits over the range between the saturation limits.
// Capacitances: the AD7746's 4 aF. Film: 10 bit of 5 V. Taxels: one count.
inline double converter_step(const Sensor& sensor, std::size_t channel) {
    if (is_piezo(sensor, channel)) return 5.0 / 1024;
    if (sensor.model == Model::capacitive) return 4e-6;  // pF
    if (sensor.model == Model::taxel) return 1;
    return 2.5 * half_range(sensor, channel) / (sensor.model == Model::table ? 4096 : 65536);
}

}  // namespace tactiled::sim
