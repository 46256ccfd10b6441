// Parts of the bounds of several effects.
#pragma once
#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/warmth.hpp"
#include "drivers/sim/scene.hpp"

namespace tactiled::sim {

// Change by rounding errors of the arithmetic, which matters only if a rounding to steps comes after it.
inline constexpr double kLastBits_N = 1e-12;

// Reading of a channel when each force is at full scale: half the range of its converter.
inline double half_range(const Sensor& sensor, std::size_t channel) {
    double sum = 0;
    for (std::size_t axis = kFx; axis <= kFz; ++axis)
        sum += std::abs(sensor.gain[sensor.is_dummy(channel) ? 0 : channel][axis]);
    return sum * sensor.full_scale_N;
}

inline bool is_piezo(const Sensor& sensor, std::size_t channel) {
    return sensor.model == Model::capacitive && sensor.channels[channel] == "Vp";
}

// Sums the bounds of some effects, for the effects of time, which come before all others.
inline double others_N(const Setting& s, std::initializer_list<std::string_view> names) {
    double sum = 0;
    for (std::size_t i = 0; i < s.stated_N.size(); ++i)
        if (std::find(names.begin(), names.end(), chain()[i]->name) != names.end()) sum += s.stated_N[i];
    return sum;
}

// Returns the largest change of the influence of temperature on a reading within that time, N. The heat of a body comes
// through the skin within a time constant, or within the scene if that is shorter; the charge of a warm film may leak at any
// rate. A gradient moves at the rate of its shortest period.
inline constexpr double kGradient_1_s = 63;  // 2 pi / 0.1 s
inline double warming_N(const Setting& s, double seconds) {
    const double length_s = std::max(double(s.samples) / s.rate_Hz, 1e-9);
    const double through_1_s = 1 / length_s + 1 / diffusion_s(s.sensor), film_1_s = 2 * through_1_s + 20;
    double sum = std::min(2.0, through_1_s * seconds) * others_N(s, {"contact_heat"}) +
                 std::min(2.0, film_1_s * seconds) * others_N(s, {"pyroelectric"}) +
                 std::min(2.0, kGradient_1_s * seconds) * others_N(s, {"temperature_gradient"});
    if (s.extent.ambient_K > 0)
        sum += std::min(2.0, s.extent.ambient_rate_K_s / s.extent.ambient_K * seconds) *
               others_N(s, {"temperature_zero", "temperature_gain", "lead_wires", "excitation_drift"});
    return sum;
}

// Returns the largest difference between a reading and a weighted mean of its past. `older(t)` = share of the weights
// of values that are more than t seconds old, `horizon_s` = age at which that share is small.
template <class Older>
double lag_N(const Setting& s, double horizon_s, Older older) {
    constexpr int kSteps = 48;
    double sum = 0, share = older(0.0);
    for (int i = 1; i <= kSteps; ++i) {
        const double age = horizon_s * i * i / (kSteps * kSteps), left = older(age);
        sum += (share - left) * s.before.change_N(s, age);
        share = left;
    }
    return sum + share * s.before.change_N(s, s.extent.length_s + horizon_s) + kLastBits_N;
}

// Returns the largest change of a sample with that error of its time.
inline double shift_N(const Setting& s, double seconds) {
    Load change = s.extent.changes(seconds);
    if (s.body.texture_height_m > 0 && s.extent.speed_m_s > 0) {  // the ridge is at another phase
        const double turn = 6.283185307179586 * s.extent.speed_m_s * seconds / s.body.texture_pitch_m;
        for (std::size_t axis = 0; axis < kAxes; ++axis) change[axis] += std::min(2.0, turn) * s.extent.max[axis];
    }
    // Effects that depend on place, speed or acceleration may have any value in their range.
    double other_N = warming_N(s, seconds);
    if (s.extent.moved_m > 0)
        other_N += 2 * others_N(s, {"load_moment", "contact_patch", "hertz_contact", "tilt", "partial_slip"});
    if (s.extent.speed_m_s > 0) {
        other_N += 2 * others_N(s, {"stick_slip"});
        // The body may slide at one time and stand still at the other, so that friction and ridges differ.
        other_N += others_N(s, {"friction_limit", "texture"});
    }
    if (s.extent.acceleration_m_s2 > 0) other_N += 2 * others_N(s, {"cap_weight"});
    return s.sensor.channel_N(change) + other_N;
}

// Returns the largest change of each component of the load alone if no channel changes by more than 1 N; 0 if no
// channel responds to it.
inline Load observed(const Sensor& sensor) {
    Load result{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) result[axis] = load_of_error(sensor, Axis(axis));
    return result;
}

}  // namespace tactiled::sim
