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
    // Not published. Set by the node, from `age` on by wire/stream_age.hpp.
    std::uint32_t opening = 0;  // how often the link had been opened
    enum class Age : std::uint8_t {
        proved,        // t_ns is not later than the measurement, but for the least delay of the path
        arrival_only,  // nothing shows a delay, and nothing would
        unproved       // t_ns is when it arrived; it may be older
    } age = Age::proved;
    std::uint8_t sequence_bits = 32;  // width of the device's counter. Set by drivers of streams
    std::uint64_t late_ns = 0;        // the age when it was taken from the kernel, where that is known
    // Not published. Set by drivers of streams, 0 = t_ns.
    std::uint64_t taken_ns = 0;  // when its last byte was taken from the kernel; t_ns may be an earlier estimate
    std::uint64_t since_ns = 0;  // it may have come at any time since then, because the process stood still; 0 = it did not

    std::uint64_t t_ns = 0;            // CLOCK_MONOTONIC when the frame's last byte was taken from the kernel, or earlier
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
