// What the bounds of several effects have in common: how large a load, and how large a reading, may become.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "drivers/sim/effect.hpp"
#include "drivers/sim/effects/influence.hpp"
#include "drivers/sim/effects/pad.hpp"

namespace tactiled::sim {

// What effects of the contact may add to the load of a scene: the ridges of a texture as much as there is, stick-slip what
// the friction at rest is above that in motion, adhesion its pull-off force; and the weight of the cap, pad or plate from
// the first sample on. All of it is seen a twentieth part on the other axes by a sensor that stands askew.
struct Added {
    std::array<double, kAxes> waves{}, steady{}, askew{};

    explicit Added(const Setting& s) {
        const auto& most = s.extent.most;
        const bool slides = s.extent.speed_m_s > 0;
        const double drop = std::max(0.0, s.body.friction - s.body.kinetic_friction);
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
            if (slides && s.body.texture_height_m > 0) waves[axis] = most[axis];
            if (slides && axis < kFz)
                waves[axis] += std::min(2 * drop * most[kFz], most[axis] * drop / std::max(s.body.kinetic_friction, 1e-9));
        }
        waves[kFz] += 1.5 * std::numbers::pi * std::max(s.body.adhesion_J_m2, 0.0) * s.body.radius_m;
        const CapacitiveSample& pad = s.sensor.capacitive;
        const double plate = s.sensor.table.plate_radius_m, R = pad.disc_radius_m;
        const double mass_kg = s.sensor.model == Model::hair         ? 1100 * s.sensor.hair.area_m2 * s.sensor.hair.height_m
                               : s.sensor.model == Model::capacitive ? 1100 * std::numbers::pi * R * R * pad.gap_m
                                                                     : 1200 * std::numbers::pi * plate * plate * 60e-6;
        steady[kFz] = 1.01 * mass_kg * (9.81 + s.extent.acceleration_m_s2);
        askew = across(most);
    }
    // Of loads as large as that.
    [[nodiscard]] std::array<double, kAxes> across(const std::array<double, kAxes>& load) const {
        std::array<double, kAxes> all{};
        for (std::size_t axis = 0; axis < kAxes; ++axis) all[axis] = load[axis] + 2 * waves[axis] + steady[axis];
        const double force = 0.05 * std::hypot(all[kFx], all[kFy], all[kFz]), moment = 0.05 * std::hypot(all[kMx], all[kMy]);
        return {force, force, force, moment, moment};
    }
};

// The largest load that an effect may meet, its largest less its least, and its change within some seconds.
inline double most(const Setting& s, Axis axis) {
    const Added added(s);
    return kMargin * s.extent.most[axis] + added.waves[axis] + added.steady[axis] + added.askew[axis];
}
inline double span(const Setting& s, Axis axis) {
    const Added added(s);
    return kMargin * s.extent.span[axis] + 2 * (added.waves[axis] + added.askew[axis]) + added.steady[axis];
}
inline double change(const Setting& s, Axis axis, double seconds) {
    const Added added(s);
    const auto changes = s.extent.changes(seconds);
    return kMargin * changes[axis] + 2 * added.waves[axis] + added.steady[axis] + added.across(changes)[axis];
}

// How far a component of the load may come back. Where none does in the scene, a sensor that stands askew may still see one.
inline double comes_back(const Setting& s, Axis axis) {
    const bool may = s.extent.reverses || s.extent.speed_m_s > 0 || s.extent.acceleration_m_s2 > 0;
    const Added added(s);
    return may ? span(s, axis) : 2 * added.askew[axis] + added.steady[axis];
}

// Of the surface, from its centre.
inline double half_size_m(const Sensor& sensor) {
    if (sensor.model == Model::table) return sensor.table.plate_radius_m;
    if (sensor.model == Model::capacitive) return sensor.capacitive.disc_radius_m;
    return std::sqrt(sensor.hair.area_m2 / std::numbers::pi);
}

// An error of 1 N in the channels (Sensor::channel_N) that the load of one axis makes is at most so many N of that axis:
// what an effect that looks at the load itself must expect of an error before it. N/N
inline double load_of_error(const Sensor& sensor, Axis axis) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < sensor.n(); ++k)
        if (sensor.gain[k][axis] != 0) least = std::min(least, sensor.per_N[k] / std::abs(sensor.gain[k][axis]));
    return std::isfinite(least) ? least : 0;
}

// Stress of a round skin under an eccentric load is F/A (1 + 4 x x0 / R^2): how much more of the press hair k (at 0, 90,
// 180, 270 degrees) feels for each metre of the load's centre along its own axis.
inline double lever_1_m(const HairSample& hair) { return 4 * hair.root_distance_m * std::numbers::pi / hair.area_m2; }

// |channel - zero| is at most that, all loads and what the transducer's geometry makes of them included; channel's unit.
inline std::array<double, kMostChannels> largest_swing(const Setting& s) {
    const Sensor& sensor = s.sensor;
    const double size = half_size_m(sensor), x_m = std::min(s.extent.x_m, size), y_m = std::min(s.extent.y_m, size);
    std::array<double, kMostChannels> swing{};
    for (std::size_t k = 0; k < sensor.n(); ++k)
        for (std::size_t axis = 0; axis < kAxes; ++axis) swing[k] += std::abs(sensor.gain[k][axis]) * most(s, Axis(axis));
    if (sensor.model == Model::hair)
        for (std::size_t k = 0; k < sensor.n(); ++k)
            swing[k] += std::abs(sensor.gain[k][kFz]) * most(s, kFz) * lever_1_m(sensor.hair) * std::max(x_m, y_m);
    if (sensor.model == Model::table && makes_patch(s.body) && has_map(sensor.table)) {
        const auto excess = InfluenceMap(sensor.table).largest_excess(s.extent.x_m, s.extent.y_m, s.body.radius_m);
        for (std::size_t k = 0; k < sensor.n(); ++k)
            for (std::size_t axis = 0; axis < 3; ++axis) swing[k] += excess[k][axis] * most(s, Axis(axis));
    }
    if (sensor.model == Model::capacitive) {
        const Pad pad(sensor);
        const double strain = pad.strain_per_N * most(s, kFz);
        const double shift = pad.shift_per_N_m * std::hypot(most(s, kFx), most(s, kFy));
        for (std::size_t i = 0; i < pad.n; ++i) {
            const double tilt = pad.tilt_strain(i, x_m, y_m) * most(s, kFz);
            const double moved =
                pad.active_pF[i] * ((1 + pad.largest_overlap(i, shift) + tilt) * Pad::closeness(strain) - 1);
            swing[pad.channel[i]] = std::max(swing[pad.channel[i]] + tilt * pad.active_pF[i], moved);
        }
        const std::size_t film = sensor.find("Vp");  // behind its leak it swings over the whole span
        if (film < sensor.n()) swing[film] *= std::max(1.0, s.extent.span[kFz] / std::max(s.extent.most[kFz], 1e-30));
    }
    return swing;
}

}  // namespace tactiled::sim
