// The result of a driver: the channels of one device at one instant, as the device sent them.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "config/names.hpp"

namespace tactiled {

// The members from `t_ns` on are laid out as those of struct tactiled_frame, so that the node publishes a frame without a
// copy in between (node/shm/frame_record.hpp).
struct Frame {
    std::uint32_t opening = 0;         // how often the link had been opened; set by the node, not published
    std::uint64_t t_ns = 0;            // CLOCK_MONOTONIC when the frame's last byte was taken from the kernel
    std::uint64_t device_time_us = 0;  // the device's own clock, any origin; 0 if it sends none
    std::uint32_t sequence = 0;        // the device's counter, valid where has_sequence
    std::uint32_t missing = 0;         // bit n: channel n has no value; its number is NaN
    std::uint32_t saturated = 0;       // bit n: channel n is at a saturation limit that the driver knows of
    std::uint32_t lost = 0;            // frames of this device that the driver knows are missing right before this one
    std::uint16_t device = 0;          // which device of the link: CAN id, mux channel, 0 where a link has but one
    std::uint8_t n_channels = 0;       // 0 also where two devices send under one name, because no channel can be assigned
    bool has_sequence = false;
    std::uint32_t reserved = 0;
    std::array<double, kMaxChannels> channel{};  // raw: counts of a converter (exact), or the number that was printed
};

}  // namespace tactiled
