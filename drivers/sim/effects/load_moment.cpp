// Load moment: an eccentric press tilts a soft skin and presses more on the sensing elements near to it.
#include <cmath>

#include "drivers/sim/effects/pad.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// Change of channel k per 1 N of drive along fz and per metre of the load's centre along x and along y.
struct Lever {
    double x, y;
};

Lever lever(const Sensor& sensor, std::size_t k) {
    if (sensor.is_dummy(k)) return {0, 0};
    if (sensor.model == Model::hair) {
        constexpr double kAt[HairSample::kHairs][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
        const double of = sensor.gain[k][kFz] * lever_1_m(sensor.hair);
        return {of * kAt[k][0], of * kAt[k][1]};
    }
    const Pad pad(sensor);
    for (std::size_t i = 0; i < pad.n; ++i)
        if (pad.channel[i] == k)
            return {-pad.active_pF[i] * pad.tilt_rad_per_Nm / pad.gap_m * pad.x_m[i],
                    -pad.active_pF[i] * pad.tilt_rad_per_Nm / pad.gap_m * pad.y_m[i]};
    return {0, 0};
}

std::unique_ptr<Effect> make(const Setting& s) {
    std::array<Lever, kMaxSensorChannels> levers{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) levers[k] = lever(s.sensor, k);
    return each_sample([channels = s.sensor.n(), size_m = half_size_m(s.sensor), levers](Block& block, std::size_t n) {
        const double x = std::clamp(block.x_m[n], -size_m, size_m), y = std::clamp(block.y_m[n], -size_m, size_m);
        const double fz = block.drive[kFz][n];
        for (std::size_t k = 0; k < channels; ++k) block.channel[k][n] += (levers[k].x * x + levers[k].y * y) * fz;
    });
}

Bound bound(const Setting& s) {
    const double x = std::min(s.extent.x_m, half_size_m(s.sensor)), y = std::min(s.extent.y_m, half_size_m(s.sensor));
    Channels per_N{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k)
        per_N[k] = std::abs(lever(s.sensor, k).x) * x + std::abs(lever(s.sensor, k).y) * y;
    const double max_N = s.sensor.largest_N(per_N);
    const double change_N = max_N * max(s, kFz);
    return {.change_N = change_N,
            .gain = 1 + max_N * load_of_error(s.sensor, kFz),
            .own_N = s.extent.moved_m > 0 ? change_N : 0};
}

const EffectEntry entry{
    .name = "load_moment",
    .title = "tilt by an eccentric load",
    .equation = "hair: sigma = F/A (1 + 4 x x0 / R^2); pad: strain + x x0 F / (gap tilt stiffness)",
    .source = "derived; a bonded disc's tilt stiffness from the lubrication theory of its press stiffness",
    .stage = Stage::transducer,
    .instructions = 120,
    .models = kHair | kCapacitive,
    .bound = bound,
    .make = make,
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
