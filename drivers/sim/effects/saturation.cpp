// Saturation: a reading is limited to the range of its converter.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    const Channels limit = per_channel(s, [&](std::size_t k) { return s.p[0] * half_range(s.sensor, k); });
    const Channels min = per_channel(s, [&](std::size_t k) { return s.sensor.zero[k] - limit[k]; });
    const Channels max = per_channel(s, [&](std::size_t k) { return s.sensor.zero[k] + limit[k]; });
    return each_reading(s, [min, max](double r, std::size_t k) { return std::clamp(r, min[k], max[k]); });
}

// The part beyond a limit; 0 where the load cannot reach it.
Bound bound(const Setting& s) {
    const Channels swing = largest_swing(s);
    const auto beyond = [&](std::size_t k) { return std::max(swing[k] - s.p[0] * half_range(s.sensor, k), 0.0); };
    return {.change_N = s.sensor.largest_N(per_channel(s, beyond))};
}

const EffectEntry entry{.name = "saturation",
                        .title = "saturation limits of the converter",
                        .equation = "r = min(max(r, zero - rail), zero + rail)",
                        .source = "full scales: 10 N of the capacitive sensor, 2 kPa of the hairs, 1 N of the table",
                        .stage = Stage::converter,
                        .instructions = 150,
                        .models = kAll | kTaxel,
                        .parameters = {{"rail", "of the reading with each force at full scale", 1.25, 0.01, 1e3}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
