// What the bounds of several effects are made of.
#pragma once
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>

#include "drivers/sim/effects/warmth.hpp"
#include "drivers/sim/scene.hpp"

namespace tactiled::sim {

inline constexpr double kByModel = std::numeric_limits<double>::quiet_NaN();  // default of a parameter

// What arithmetic alone changes: nothing, unless a rounding to steps comes after it.
inline constexpr double kLastBits_N = 1e-12;

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

// What the effects of contact, material and transducer that `counts` picks can change within an extent, N.
template <class Counts>
double others_N(const Setting& s, const Extent& extent, Counts counts) {
    if (s.scene == nullptr) return 0;
    double sum = 0;
    for (std::size_t i = 0; i < chain().size(); ++i) {
        const EffectEntry& other = *chain()[i];
        if ((other.models >> unsigned(s.sensor.model) & 1u) == 0 || !counts(other)) continue;
        if (other.stage == Stage::contact || other.stage == Stage::material || other.stage == Stage::transducer)
            sum += other.bound(s.scene->setting(i, s.sensor, extent)).change_N;
    }
    return sum;
}
inline double others_N(const Setting& s, const Extent& extent, std::initializer_list<std::string_view> names) {
    return others_N(s, extent,
                    [&](const EffectEntry& e) { return std::find(names.begin(), names.end(), e.name) != names.end(); });
}

// By how much what temperature does to a reading can change within so many seconds, N. A body's warmth comes through the
// skin within a time constant, or within the scene if that is shorter; a warm film's charge leaks as fast as any.
inline double warming_N(const Setting& s, double seconds) {
    Extent alone = s.extent;
    alone.body_K = 0;
    const double length_s = std::max(double(s.samples) / s.rate_Hz, 1e-9);
    const double through_1_s = 1 / length_s + 1 / diffusion_s(s.sensor), film_1_s = 2 * through_1_s + 20;
    double sum = 0;
    if (s.extent.ambient_K > 0) {
        const double rate_1_s = s.extent.ambient_rate_K_s / s.extent.ambient_K;
        sum += std::min(2.0, rate_1_s * seconds) * others_N(s, alone, {"temperature_zero", "temperature_gain"});
        sum += std::min(2.0, film_1_s * seconds) * others_N(s, alone, {"pyroelectric"});
    }
    alone = s.extent;
    alone.ambient_K = alone.ambient_rate_K_s = 0;
    if (s.extent.body_K > 0) {
        sum += std::min(2.0, through_1_s * seconds) * others_N(s, alone, {"contact_heat"});
        sum += std::min(2.0, film_1_s * seconds) * others_N(s, alone, {"pyroelectric"});
    }
    return sum;
}

// What a filter meets beside the load: what is fast, at most from one end to the other, and what is slow.
inline double beside_N(const Setting& s, double mean_s) {
    const double fast =
        others_N(s, s.extent, {"texture", "stick_slip", "adhesion", "dome_resonance", "triboelectric", "zero_walk"});
    return 2 * fast + warming_N(s, mean_s);
}

// Of a channel, by what goes up to `load` and by what all others before the converter add to it.
inline Channels with_others(const Setting& s, const std::array<double, kAxes>& load) {
    Channels result = channel_changes(s.sensor, load);
    const double more_N = 0.005 * s.sensor.full_scale_N + others_N(s, s.extent, [](const EffectEntry&) { return true; });
    for (std::size_t k = 0; k < s.sensor.n(); ++k) result[k] += more_N * s.sensor.per_N[k];
    return result;
}
inline Channels swings(const Setting& s) { return with_others(s, s.extent.most); }  // largest |reading - zero|

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
    return any ? s.sensor.largest_N(change) + beside_N(s, mean_s) + kLastBits_N : 0;
}

// By how much a sample can differ that is taken so many seconds off.
inline double shift_N(const Setting& s, double seconds) {
    std::array<double, kAxes> change = s.extent.changes(seconds);
    if (s.body.texture_height_m > 0 && s.extent.speed_m_s > 0) {  // it meets another place of a ridge
        const double turn = 6.283185307179586 * s.extent.speed_m_s * seconds / s.body.texture_pitch_m;
        for (std::size_t axis = 0; axis < kAxes; ++axis) change[axis] += std::min(2.0, turn) * s.extent.most[axis];
    }
    return s.sensor.channel_N(change) + warming_N(s, seconds);
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
