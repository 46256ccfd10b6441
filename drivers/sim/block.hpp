// The samples of one sensor on their way through the simulator, kSize at a time, one array a quantity.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

namespace tactiled::sim {

inline constexpr std::size_t kMaxSensorChannels = 8;  // of one sensor
inline constexpr std::size_t kAxes = 5;               // fx fy fz (N), mx my (Nm): no sensor here measures mz
enum Axis : std::size_t { kFx, kFy, kFz, kMx, kMy };

struct Block {
    static constexpr std::size_t kSize = 64;
    using Row = std::array<double, kSize>;

    std::uint64_t first = 0;  // number of the first sample since the scene began: what happens hangs on it, never on the
    std::size_t n = 0;        // size of a block. n = how many there are.

    Row t_s;  // since the scene began, when each sample is taken

    // The world at the sensor's surface, frame S.
    std::array<Row, kAxes> load;  // what the world exerts on it; a press has fz < 0; moments about the origin
    Row x_m, y_m;                 // centre of contact
    Row radius_m;                 // of the contact
    Row slide_m, speed_m_s;       // path slid so far and its rate, >= 0
    Row ambient_K, body_K;        // above the temperature at which the scene began; the body's
    Row acceleration_m_s2;        // of the sensor, against gravity

    // Output of the sensor's material, as the load that would cause it in the linear model.
    std::array<Row, kAxes> drive;

    // Readings of the channels, in the sensor's unit.
    std::array<Row, kMaxSensorChannels> channel;

    std::array<std::uint32_t, kSize> missing;  // bit k: channel k has no value
    std::array<std::uint32_t, kSize> lost;     // frames lost right before this one
    std::array<bool, kSize> dropped;           // this frame itself never arrives
    // Frames that arrive at each sample's turn, in order, at most two: 1 + how many of the sensor's frames ago it was its
    // own turn; 0 = none. {1, 0} where the link does nothing. arrivals.hpp hands them out.
    std::array<std::array<std::uint8_t, 2>, kSize> arrives;
};

}  // namespace tactiled::sim
