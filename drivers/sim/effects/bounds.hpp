// What the bounds of several effects are made of.
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

inline constexpr double kByModel = std::numeric_limits<double>::quiet_NaN();  // default of a parameter

using Channels = std::array<double, kMostChannels>;

// The largest change of each channel, in its unit, when each component of the load changes by at most that much.
inline Channels channel_changes(const Sensor& sensor, const std::array<double, kAxes>& change) {
    Channels result{};
    for (std::size_t k = 0; k < sensor.n(); ++k)
        for (std::size_t axis = 0; axis < kAxes; ++axis) result[k] += std::abs(sensor.gain[k][axis]) * change[axis];
    return result;
}

// Reading of a channel when each force is at full scale: half the range that its converter is made for.
inline double half_range(const Sensor& sensor, std::size_t channel) {
    double sum = 0;
    for (std::size_t axis = kFx; axis <= kFz; ++axis) sum += std::abs(sensor.gain[channel][axis]);
    return sum * sensor.full_scale_N;
}

inline bool is_piezo(const Sensor& sensor, std::size_t channel) {
    return sensor.model == Model::capacitive && sensor.channels[channel] == "Vp";
}

// What temperature does to a reading, at most, N a K: platinum on hairs reads 8 kPa a K, four times its full scale; a warm
// film gives charge as 10 N would; Ni-Cr on a plate 5 mN.
inline double thermal_N(const Sensor& sensor, double change_K) {
    const double full_scales = sensor.model == Model::hair ? 4 : sensor.model == Model::capacitive ? 12 : 0.05;
    return full_scales * sensor.full_scale_N * change_K;
}

// Of the sensor, at most: with its surroundings, or at the touch of a body through its skin.
inline double warming_K_s(const Extent& extent) { return extent.ambient_rate_K_s + 2 * extent.body_K; }

// Of a channel, by what goes up to `load` and by what adds to it: noise, temperature, what stands before an effect.
inline Channels with_margin(const Setting& s, const std::array<double, kAxes>& load) {
    Channels result = channel_changes(s.sensor, load);
    const double more_N = 0.02 * s.sensor.full_scale_N + thermal_N(s.sensor, s.extent.ambient_K + s.extent.body_K);
    for (std::size_t k = 0; k < s.sensor.n(); ++k) result[k] = kMargin * result[k] + more_N * s.sensor.per_N[k];
    return result;
}
inline Channels swings(const Setting& s) { return with_margin(s, s.extent.most); }  // largest |reading - zero|
inline Channels spans(const Setting& s) { return with_margin(s, s.extent.span); }   // largest reading less least

// Largest difference between the load now and a weighted mean of the load before. `older(s)` = share of the weights of what
// is more than s seconds old, `horizon_s` = where it has become small.
template <class Older>
std::array<double, kAxes> lag_changes(const Extent& extent, double horizon_s, Older older) {
    constexpr int kSteps = 48;
    std::array<double, kAxes> sum{};
    double share = older(0.0);
    for (int i = 1; i <= kSteps; ++i) {
        const double age = horizon_s * i * i / (kSteps * kSteps), left = older(age);
        const std::array<double, kAxes> change = extent.changes(age);
        for (std::size_t axis = 0; axis < kAxes; ++axis) sum[axis] += (share - left) * change[axis];
        share = left;
    }
    for (std::size_t axis = 0; axis < kAxes; ++axis) sum[axis] += share * extent.span[axis];
    return sum;
}

// Of a filter on the channels that `filtered` names: such a mean of their past, over `mean_s` seconds on average.
template <class Older, class Filtered>
double lag_N(const Setting& s, double horizon_s, double mean_s, Older older, Filtered filtered) {
    Channels change = channel_changes(s.sensor, lag_changes(s.extent, horizon_s, older));
    bool any = false;
    for (std::size_t k = 0; k < s.sensor.n(); ++k) {
        change[k] = filtered(k) ? kMargin * change[k] : 0;
        any = any || filtered(k);
    }
    return any ? s.sensor.largest_N(change) + thermal_N(s.sensor, warming_K_s(s.extent) * mean_s) : 0;
}

// By how much a sample can differ that is taken so many seconds off.
inline double shift_N(const Setting& s, double seconds) {
    std::array<double, kAxes> change = s.extent.changes(seconds);
    if (s.body.texture_height_m > 0 && s.extent.speed_m_s > 0) {  // it meets another place of a ridge
        const double turn = 6.283185307179586 * s.extent.speed_m_s * seconds / s.body.texture_pitch_m;
        for (std::size_t axis = 0; axis < kAxes; ++axis) change[axis] += std::min(2.0, turn) * s.extent.most[axis];
    }
    return s.sensor.channel_N(change) + thermal_N(s.sensor, warming_K_s(s.extent) * seconds);
}

// The largest change of each component of the load alone when no channel changes by more than 1 N; 0 where none feels it.
inline std::array<double, kAxes> felt(const Sensor& sensor) {
    std::array<double, kAxes> result{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
        std::array<double, kAxes> unit{};
        unit[axis] = 1;
        const double channel_N = sensor.channel_N(unit);
        if (channel_N > 0) result[axis] = 1 / channel_N;
    }
    return result;
}

}  // namespace tactiled::sim
