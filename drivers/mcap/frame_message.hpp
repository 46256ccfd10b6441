// A Frame as a message of a recording, with all its bits and the wall clock.
#pragma once
#include <span>
#include <string>
#include <string_view>

#include "drivers/frame.hpp"

namespace tactiled::mcap {

inline constexpr std::string_view kFrameSchema = "tactiled_msgs/msg/Frame";
extern const std::string_view kFrameDefinition;       // in the format of ROS 2 message definitions
inline constexpr std::string_view kLinkKey = "link";  // key of the link's name in the channel's metadata

void encode_frame(const Frame& frame, std::uint64_t wall_ns, std::string& out);
// Returns false if the bytes are not such a message, or if it has more channels than a Frame.
[[nodiscard]] bool decode_frame(std::span<const char> bytes, Frame& frame);

}  // namespace tactiled::mcap
