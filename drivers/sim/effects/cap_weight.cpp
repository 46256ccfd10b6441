// Weight and inertia of the part on the sensing element: cap, pad or plate.
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

// Density times volume: PDMS cap, silicone pad, SU-8 plate of 60 um.
double mass_kg(const Setting& s) {
    if (!std::isnan(s.p[0])) return s.p[0];
    constexpr double kPi = 3.141592653589793;
    const CapacitiveSample& pad = s.sensor.capacitive;
    if (s.sensor.model == Model::hair) return 1030 * s.sensor.hair.area_m2 * s.sensor.hair.height_m;
    if (s.sensor.model == Model::capacitive) return 1070 * kPi * pad.disc_radius_m * pad.disc_radius_m * pad.gap_m;
    return 1200 * kPi * s.sensor.table.plate_radius_m * s.sensor.table.plate_radius_m * 60e-6;
}

// Added to the channels directly, to first order: it is small, so it does not change the load of other effects.
std::unique_ptr<Effect> make(const Setting& s) {
    const Channels per_N = per_channel(s, [&](std::size_t k) {
        return std::sin(s.p[2]) * s.sensor.gain[k][kFx] - std::cos(s.p[2]) * s.sensor.gain[k][kFz];
    });
    return each_reading(
        s, [per_N, mass_kg = mass_kg(s), gravity_m_s2 = s.p[1]](double r, std::size_t k, const Block& block, std::size_t n) {
            return r + per_N[k] * mass_kg * (gravity_m_s2 + block.acceleration_m_s2[n]);
        });
}

Bound bound(const Setting& s) {
    const double max_N = mass_kg(s) * (std::abs(s.p[1]) + s.extent.acceleration_m_s2);
    const double by_acceleration = s.extent.acceleration_m_s2 * mass_kg(s);
    return {
        .change_N = s.sensor.channel_N({std::abs(std::sin(s.p[2])) * max_N, 0, std::abs(std::cos(s.p[2])) * max_N, 0, 0}),
        .own_N = s.sensor.channel_N({by_acceleration, 0, by_acceleration, 0, 0})};
}

const EffectEntry entry{
    .name = "cap_weight",
    .title = "weight and inertia of the cap",
    .equation = "r = r + G m (g + a)",
    .source = "derived; Cao et al.'s cap of 1 mm weighs 10 Pa, above its threshold of 7.2 Pa",
    .stage = Stage::transducer,
    .instructions = 100,
    .parameters = {{"mass_kg", "by default density times volume", kByModel, 0, 1},
                   {"gravity_m_s2", "against the attitude in which the zero was taken", 9.80665, -20, 20},
                   {"tilt_rad", "of the weight, from -z towards +x", 0, -6.3, 6.3}},
    .bound = bound,
    .make = make,
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
