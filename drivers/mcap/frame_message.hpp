// A Frame as a message of a recording: every bit of it, and the wall clock beside.
#pragma once
#include <span>
#include <string>
#include <string_view>

#include "drivers/frame.hpp"

namespace tactiled::mcap {

inline constexpr std::string_view kFrameSchema = "tactiled_msgs/msg/Frame";
extern const std::string_view kFrameDefinition;       // as ROS 2 writes message definitions
inline constexpr std::string_view kLinkKey = "link";  // in the channel's metadata: the link's name

void encode_frame(const Frame& frame, std::uint64_t wall_ns, std::string& out);
// False where the bytes are no such message, or one with more channels than a Frame has.
[[nodiscard]] bool decode_frame(std::span<const char> bytes, Frame& frame);

}  // namespace tactiled::mcap
