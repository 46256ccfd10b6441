// The common part of the bounds of several effects: the largest load and the largest reading.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

// The largest load that an effect may meet, the difference between its largest and smallest value, and its change
// within some seconds.
inline double max(const Setting& s, Axis axis) { return s.extent.max[axis]; }
inline double span(const Setting& s, Axis axis) { return s.extent.span[axis]; }
inline double change(const Setting& s, Axis axis, double seconds) { return s.extent.change(axis, seconds); }
// The largest decrease of a component of the load.
inline double comes_back(const Setting& s, Axis axis) {
    return s.extent.reverses ? span(s, axis) : std::min(span(s, axis), s.extent.back[axis]);
}

// Distance from the centre of the surface to its edge.
inline double half_size_m(const Sensor& sensor) {
    if (sensor.model == Model::table) return sensor.table.plate_radius_m;
    if (sensor.model == Model::capacitive) return sensor.capacitive.disc_radius_m;
    if (sensor.model == Model::taxel) return sensor.pitch_m / 2;
    return std::sqrt(sensor.hair.area_m2 / std::numbers::pi);
}

// The load of one axis that corresponds to an error of 1 N in the channels (Sensor::channel_N), N/N: the bound of an effect
// that uses the load must include this error.
inline double load_of_error(const Sensor& sensor, Axis axis) {
    double min = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < sensor.n(); ++k)
        if (sensor.gain[k][axis] != 0) min = std::min(min, sensor.per_N[k] / std::abs(sensor.gain[k][axis]));
    return std::isfinite(min) ? min : 0;
}

// The stress of a round skin under an eccentric load is F/A (1 + 4 x x0 / R^2): additional share of the press on hair
// k (at 0, 90, 180, 270 degrees) per metre of the load's centre along its own axis.
inline double lever_1_m(const HairSample& hair) { return 4 * hair.root_distance_m * std::numbers::pi / hair.area_m2; }

// Upper limit of |channel - zero|, in the channel's unit.
inline Channels largest_swing(const Setting& s) {
    Channels swing{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) {
        for (std::size_t axis = 0; axis < kAxes; ++axis) swing[k] += std::abs(s.sensor.gain[k][axis]) * max(s, Axis(axis));
        swing[k] += s.before.max_N * s.sensor.per_N[k];
    }
    return swing;
}

// Bound of an effect of the material that changes each component of the load by at most `change`; `gain` holds for the load
// and its rate.
inline Bound bound_of_load(const Setting& s, const Load& change, double gain = 1) {
    return {.change_N = s.sensor.channel_N(change), .gain = gain, .load = change, .load_gain = gain};
}

// Bound of an effect that changes each channel by at most `change`, at any rate and without a change of the load.
inline Bound bound_of_own(const Setting& s, const Channels& change, double gain = 1) {
    const double change_N = s.sensor.largest_N(change);
    return {.change_N = change_N, .gain = gain, .own_N = change_N};
}

}  // namespace tactiled::sim
