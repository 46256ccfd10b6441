// The result of a driver: the channels of one device at one instant, as the device sent them.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "config/names.hpp"

namespace tactiled {

// The members from `t_ns` on have the layout of struct tactiled_frame, so that the node publishes a frame without a
// copy (node/shm/frame_record.hpp).
struct Frame {
    // Not published. The node sets `opening`, and wire/stream_age.hpp the members from `age` on.
    std::uint32_t opening = 0;  // number of the opening of the link
    enum class Age : std::uint8_t {
        proved,        // t_ns is not later than the measurement, except for the minimum delay of the path
        arrival_only,  // no sign of a delay, but a delay would not show
        unproved       // t_ns is the time of arrival; the frame may be older
    } age = Age::proved;
    std::uint8_t sequence_bits = 32;  // width of the device's counter. Set by drivers of streams
    bool restarted = false;           // the driver has set the device up again since the frame before
    std::uint64_t late_ns = 0;        // age of the frame when it was read from the kernel, where known
    // Not published. Set by drivers of streams, 0 = t_ns.
    std::uint64_t taken_ns = 0;  // when its last byte was read from the kernel; t_ns may be an earlier estimate
    // Earliest possible arrival. Of streams: if the process was stopped. Of answers: time of the request plus the duration
    // of both messages, or the time when the chip was ready. 0 = unknown.
    std::uint64_t since_ns = 0;
    std::uint64_t slice_ns = 0;  // of the time since since_ns: an ordinary wait; more is a stop of the process
    // The device has answered a request of this time (CLOCK_MONOTONIC), and measured this frame later; 0 = no answer has
    // come since the frame before. answered_us: the device's time in the answer.
    std::uint64_t asked_ns = 0;
    std::uint32_t answered_us = 0;
    double bound_ns = 0;  // set by wire/stream_age.hpp: the largest possible age when the frame was read

    std::uint64_t t_ns = 0;            // CLOCK_MONOTONIC when the frame's last byte was read from the kernel, or earlier
    std::uint64_t device_time_us = 0;  // the device's own clock, any origin; 0 if it sends none
    std::uint32_t sequence = 0;        // the device's counter, valid where has_sequence
    std::uint32_t missing = 0;         // bit n: channel n has no value; its number is NaN
    std::uint32_t saturated = 0;       // bit n: channel n is at a saturation limit that the driver knows
    std::uint32_t lost = 0;            // frames of this device that are known to be lost directly before this one
    std::uint16_t device = 0;          // device of the link: CAN id, mux channel; 0 if the link has one device
    std::uint8_t n_channels = 0;       // 0 also if two devices use one number, because no channel can be assigned
    bool has_sequence = false;
    std::uint32_t reserved = 0;
    std::array<double, kMaxChannels> channel{};  // raw: counts of a converter (exact), or the number in the text
};

}  // namespace tactiled
