// The keys of driver "can" that say what its messages mean: [[link.device]], with signals in place or of a DBC file.
#pragma once
#include <vector>

#include "config/options.hpp"
#include "drivers/wire/can_sample.hpp"

namespace tactiled {

inline constexpr std::size_t kCanMaxDevices = 64;  // of a link
inline constexpr std::size_t kCanMaxIds = 512;     // CAN_RAW_FILTER_MAX of the kernel

// A device whose samples come as one message of several frames.
struct CanTransport {
    std::uint32_t id = 0, reply_id = 0;  // with kCanExtended: of its frames, of our flow control
};

struct CanPlan {
    std::vector<CanDevice> devices;
    std::vector<CanTransport> transports;
    std::vector<std::uint32_t> ids;  // with kCanExtended; each once
    std::size_t max_bytes = 0;       // of a frame: more than 8 needs CAN FD
};

// Errors go to the options' Problems. setup
CanPlan read_can_plan(Options& link);

}  // namespace tactiled
