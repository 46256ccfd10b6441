// A generic taxel of an array: it counts the press on it, or all three forces, linearly.
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

void read_taxel(Options& options, Sensor& sensor) {
    const bool three = options.integer("values", {1, 3}, 1) == 3;
    const double counts_per_N = options.number("counts_per_N", {1e-3, 1e6}, 1000);
    sensor.taxel.young_Pa = options.number("young_Pa", {1e3, 1e9}, 1e6);  // a silicone of 40 Shore A
    sensor.unit = "counts";
    sensor.channels = three ? std::vector<std::string>{"X", "Y", "Z"} : std::vector<std::string>{"Z"};
    if (three) {
        sensor.gain[0][kFx] = counts_per_N;
        sensor.gain[1][kFy] = counts_per_N;
    }
    sensor.gain[sensor.n() - 1][kFz] = -counts_per_N;  // a press counts up
    sensor.full_scale_N = 5;
    sensor.resolution_N = 0.01;
}

}  // namespace tactiled::sim
