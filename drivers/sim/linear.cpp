#include "drivers/sim/linear.hpp"

namespace tactiled::sim {

std::unique_ptr<Effect> make_clock(double rate_Hz) {
    return each_sample([rate_Hz](Block& block, std::size_t n) {
        block.t_s[n] = double(block.first + n) / rate_Hz;
        block.missing[n] = 0;
        block.lost[n] = 0;
        block.dropped[n] = false;
        block.arrives[n] = {1, 0};
    });
}

std::unique_ptr<Effect> make_world(const Motion& motion, const Sensor& sensor) {
    return each_block([&motion, &sensor](Block& block) { motion.fill(block, sensor); });
}

std::unique_ptr<Effect> make_drive() {
    return each_block([](Block& block) { block.drive = block.load; });
}

std::unique_ptr<Effect> make_gauges(const Sensor& sensor) {
    return each_reading(0, sensor.n(), [&sensor](double, std::size_t k, const Block& block, std::size_t n) {
        const auto& g = sensor.gain[k];
        return sensor.zero[k] + g[kFx] * block.drive[kFx][n] + g[kFy] * block.drive[kFy][n] + g[kFz] * block.drive[kFz][n] +
               g[kMx] * block.drive[kMx][n] + g[kMy] * block.drive[kMy][n];
    });
}

}  // namespace tactiled::sim
