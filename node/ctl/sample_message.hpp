// A sample as messages of a recording: the complete sample, the WrenchStamped that Foxglove and PlotJuggler show, and
// its quality.
#pragma once
#include <span>
#include <string>
#include <string_view>

#include "decoupling/decoupler.hpp"
#include "tactiled/layout.h"

namespace tactiled::ctl {

inline constexpr std::string_view kSampleSchema = "tactiled_msgs/msg/Sample";
inline constexpr std::string_view kWrenchSchema = "geometry_msgs/msg/WrenchStamped";
inline constexpr std::string_view kQualitySchema = "tactiled_msgs/msg/Quality";
inline constexpr std::string_view kToolSchema = "tactiled_msgs/msg/Tool";
extern const std::string_view kSampleDefinition, kWrenchDefinition, kQualityDefinition,
    kToolDefinition;                                      // in the format of ROS 2 message definitions
inline constexpr std::string_view kSensorKey = "sensor";  // key of the sensor's name in the channel's metadata

// Returns the frame_id of a sensor's messages.
[[nodiscard]] inline std::string frame_id_of(const std::string& sensor, bool is_simulated) {
    return is_simulated ? sensor + " (simulated)" : sensor;
}

// The attachment with the daemon's configuration; the next attachment is the same file under its own path.
inline constexpr const char* kConfigName = "tactiled.toml";

void encode_sample(const tactiled_sample& sample, std::uint64_t wall_ns, std::string& out);
// Returns false if the bytes are not such a message.
[[nodiscard]] bool decode_sample(std::span<const char> bytes, tactiled_sample& sample);

// Encodes force and torque as readers see them: NaN if the sample is BAD or the sensor does not measure the
// component. `frame_id`: the sensor.
void encode_wrench(const tactiled_sample& sample, const std::string& frame_id, std::uint64_t wall_ns, std::string& out);
// Encodes quality and reasons of a sample as numbers and words, to be shown beside its wrench.
void encode_quality(const tactiled_sample& sample, float age_bound_s, std::uint64_t wall_ns, std::string& out);
// The wrench on the gripper: whole, and as a WrenchStamped of frame `frame_id`.
void encode_tool(const tactiled_tool& tool, std::uint64_t wall_ns, std::string& out);
void encode_wrench(const tactiled_tool& tool, const std::string& frame_id, std::uint64_t wall_ns, std::string& out);
// Converts a sample to a row of forces.csv.
[[nodiscard]] Estimate estimate_of(const tactiled_sample& sample);

}  // namespace tactiled::ctl
