// A sensor of three channels that are forces, and frames for it.
#pragma once
#include "node/sensor.hpp"
#include "tests/unit/milliseconds.hpp"
#include "through.hpp"

namespace tactiled {

// Without an sd, jumps are not checked.
inline Sensor make(double counts_per_unit = 1, double sd_N = kNaN) {
    Sensor::Setup setup;
    setup.channel_of_frame = {0, 1, 2};
    setup.frame_channels = 3;
    setup.counts_per_unit = counts_per_unit;
    setup.tuning.saturates_at = {-1000, 1000};
    setup.decoupler = std::make_unique<Through>(100, sd_N);
    Sensor sensor(std::move(setup));
    sensor.start(7, 0);
    return sensor;
}

inline Frame frame(std::uint64_t t_ns, double a, double b, double c) {
    Frame f;
    f.t_ns = t_ns;
    f.n_channels = 3;
    f.channel = {a, b, c};
    return f;
}

}  // namespace tactiled
