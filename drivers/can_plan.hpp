// The keys of driver "can" that define its messages: [[link.device]], with signals defined in place or in a DBC file.
#pragma once
#include <vector>

#include "config/options.hpp"
#include "drivers/wire/can_sample.hpp"

namespace tactiled {

inline constexpr std::size_t kCanMaxDevices = 64;  // per link
inline constexpr std::size_t kCanMaxIds = 512;     // the kernel's CAN_RAW_FILTER_MAX

// A device whose samples come as one message of several frames.
struct CanTransport {
    // with kCanExtended: the id of the device's frames, and of the flow control frames to it
    std::uint32_t id = 0, reply_id = 0;
};

struct CanPlan {
    std::vector<CanDevice> devices;
    std::vector<CanTransport> transports;
    std::vector<std::uint32_t> ids;  // with kCanExtended; each once
    std::size_t max_bytes = 0;       // payload of a frame: more than 8 needs CAN FD
};

// Reads the devices of a link. Errors go to the options' Problems. setup
CanPlan read_can_plan(Options& link);

}  // namespace tactiled
