// The raw taxels of a frame as a message of a recording, which precedes the frame's.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/taxels.hpp"

namespace tactiled::mcap {

inline constexpr std::string_view kTaxelsSchema = "tactiled_msgs/msg/Taxels";
extern const std::string_view kTaxelsDefinition;  // in the format of ROS 2 message definitions

// `t_ns`: that of the frame.
void encode_taxels(const Taxels& taxels, std::uint64_t t_ns, std::uint64_t wall_ns, std::string& out);

struct RecordedTaxels {
    std::uint64_t t_ns = 0;
    TaxelShape shape;
    std::vector<float> value;
};
// Returns false if the bytes are not such a message, or if it has more taxels than an array can have.
[[nodiscard]] bool decode_taxels(std::span<const char> bytes, RecordedTaxels& taxels);

}  // namespace tactiled::mcap
