// The samples of one sensor on their way through the simulator, kSize at a time, with one array per quantity.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

namespace tactiled::sim {

inline constexpr std::size_t kMaxSensorChannels = 8;      // channels of one sensor
using Channels = std::array<double, kMaxSensorChannels>;  // one number per channel, in its unit unless stated otherwise
inline constexpr std::size_t kAxes = 5;                   // fx fy fz (N), mx my (Nm): no sensor here measures mz
enum Axis : std::size_t { kFx, kFy, kFz, kMx, kMy };
using Load = std::array<double, kAxes>;  // N and Nm, unless stated otherwise

struct Block {
    static constexpr std::size_t kSize = 64;
    using Row = std::array<double, kSize>;

    std::uint64_t first = 0;  // number of the first sample since the scene began: effects depend on it, not on the block
    std::size_t n = 0;        // number of samples in this block

    Row t_s;  // time since the scene began at which each sample is taken

    // State of the environment at the sensor's surface, frame S.
    std::array<Row, kAxes> load;  // exerted on the sensor; a press has fz < 0; moments about the origin
    Row x_m, y_m;                 // centre of contact
    Row radius_m;                 // radius of the contact
    Row slide_m, speed_m_s;       // path slid so far and its rate, >= 0
    Row ambient_K, body_K;        // relative to the temperature at the scene's begin; the same for the body
    Row acceleration_m_s2;        // acceleration of the sensor, against gravity

    // Output of the sensor's material, as the load that would cause it in the linear model.
    std::array<Row, kAxes> drive;

    // Readings of the channels, in the sensor's unit.
    std::array<Row, kMaxSensorChannels> channel;

    std::array<std::uint32_t, kSize> missing;  // bit k: channel k has no value
    std::array<std::uint32_t, kSize> lost;     // frames lost directly before this one
    std::array<bool, kSize> dropped;           // this frame is not delivered
    // Frames that arrive at each sample time, in order, at most two: 1 + the number of the sensor's frames by which it is
    // late; 0 = none. {1, 0} without an effect of the link. See arrivals.hpp.
    std::array<std::array<std::uint8_t, 2>, kSize> arrives;
};

}  // namespace tactiled::sim
