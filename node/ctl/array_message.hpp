// The array of a sample as messages of a recording: its results as numbers, and its taxels as the PointCloud2 that the 3D
// panel of Foxglove shows. Equal arrays give equal bytes.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

inline constexpr std::string_view kArraySchema = "tactiled_msgs/msg/Array";
inline constexpr std::string_view kCloudSchema = "sensor_msgs/msg/PointCloud2";
extern const std::string_view kArrayDefinition, kCloudDefinition;  // in the format of ROS 2 message definitions

// The taxels of an array and where they are. `force_S_N` and `state` are as in a record of struct tactiled_array.
struct TaxelCloud {
    std::uint32_t rows, columns;     // columns 0: a list
    std::uint32_t components;        // bits 0..2: fx fy fz
    std::span<const float> place_S;  // place, m, and normal: six numbers for each taxel
    const float* force_S_N;
    const std::uint8_t* state;
};
[[nodiscard]] TaxelCloud cloud_of(const SegmentView& segment, std::uint32_t sensor, const Array& array);

// Encodes the results of an array: all that follows its sample, and the time of that.
void encode_array(const tactiled_array& array, std::uint64_t wall_ns, std::string& out);
// Encodes a point for each taxel, with the fields x, y, z (m), press_N, the measured ones of fx_N, fy_N and fz_N, and state
// (enum tactiled_taxel_state). The numbers of a taxel without a force are NaN. `frame_id`: the sensor.
void encode_cloud(const TaxelCloud& cloud, const std::string& frame_id, std::uint64_t wall_ns, std::string& out);

}  // namespace tactiled::ctl
