// Mounting on a curved surface: bending strains the gauges before any contact.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// The strain of a sheet's face is thickness / (2 radius) along the bend, times cos^2 for a gauge at an angle to it.
// R1 R2 R5 R6 are along x, R3 R4 R7 R8 along y.
double offset(const Setting& s, std::size_t k) {
    const bool along_x = k % 4 < 2;
    const double angle = s.p[2] * std::numbers::pi / 180, part = along_x ? std::cos(angle) : std::sin(angle);
    return s.p[0] * s.p[1] / 2 * part * part * s.sensor.table.gauge_factor_tangential;
}

Channels offsets(const Setting& s) {
    return per_channel(s, [&](std::size_t k) { return offset(s, k); });
}

std::unique_ptr<Effect> make(const Setting& s) {
    return each_reading(s, [offsets = offsets(s)](double r, std::size_t k) { return r + offsets[k]; });
}

Bound bound(const Setting& s) { return {.change_N = s.sensor.largest_N(offsets(s))}; }

const EffectEntry entry{
    .name = "mounting_curvature",
    .title = "mounting on a curve",
    .equation = "strain = thickness / (2 radius) cos^2",
    .source = "derived: 1.56 % at 8 mm, 26 times the strain of 1 N",
    .stage = Stage::transducer,
    .instructions = 60,
    .models = kTable,
    .parameters = {{"curvature_1_m", "of the surface; 0 where the zero was taken after mounting", 0, -1000, 1000},
                   {"thickness_m", "of the sensor", 250e-6, 1e-6, 0.01},
                   {"direction_deg", "of the bend, from x", 0, -360, 360}},
    .bound = bound,
    .make = make,
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
