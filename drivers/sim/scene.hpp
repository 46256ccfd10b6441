// A scene: the body, the motions, and the accuracy wanted of the sensors. It names no physical effects; choose.hpp
// selects them.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "config/options.hpp"
#include "drivers/sim/effect.hpp"
#include "drivers/sim/motion.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

struct Scene {
    std::string file, title;
    std::uint64_t seed = 1;
    double rate_Hz = 1000;
    double wanted_accuracy_N = 0;  // 0 = half of each sensor's resolution
    std::vector<Sensor> sensors;
    Body body;
    Motion motion;
    std::uint64_t samples = 0;
    // For each effect, in the order of chain(): its parameters, and whether the scene sets one.
    std::vector<std::vector<double>> parameters;

    [[nodiscard]] double wanted_N(const Sensor& sensor) const {
        return wanted_accuracy_N > 0 ? wanted_accuracy_N : sensor.resolution_N / 2;
    }
    // Returns the input of an effect. `effect` is its index in chain(). Scene, sensor and extent must outlive it.
    [[nodiscard]] Setting setting(std::size_t effect, const Sensor& sensor, const Extent& extent) const;
    // Returns the delay of each channel of a sensor by all effects together, for a slow signal as in a data sheet. setup
    [[nodiscard]] std::vector<double> delay_s(const Sensor& sensor) const;
};

// setup: throws SetupError with all errors of the file, file:line: ...
Scene read_scene(const std::string& path);
Scene read_scene(Options options, Problems& problems);

}  // namespace tactiled::sim
