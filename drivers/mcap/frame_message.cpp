#include "drivers/mcap/frame_message.hpp"

#include "drivers/mcap/cdr.hpp"

namespace tactiled::mcap {

const std::string_view kFrameDefinition =
    R"(# The channels of one device of a link at one instant, as its driver delivered them.
builtin_interfaces/Time stamp  # wall clock of t_ns
uint64 t_ns            # CLOCK_MONOTONIC when the frame's last byte was taken from the kernel
uint64 device_time_us  # the device's own clock, 0 if it sends none
uint32 sequence        # the device's counter, where has_sequence
uint32 missing         # bit n: channel n has no value
uint32 saturated       # bit n: channel n is at a rail
uint32 lost            # frames of this device that are missing right before this one
uint16 device
bool has_sequence
float64[] channel      # raw
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
)";

void encode_frame(const Frame& frame, std::uint64_t wall_ns, std::string& out) {
    CdrWriter cdr(out);
    cdr.put(std::int32_t(wall_ns / 1'000'000'000u));
    cdr.put(std::uint32_t(wall_ns % 1'000'000'000u));
    cdr.put(frame.t_ns);
    cdr.put(frame.device_time_us);
    cdr.put(frame.sequence);
    cdr.put(frame.missing);
    cdr.put(frame.saturated);
    cdr.put(frame.lost);
    cdr.put(frame.device);
    cdr.put(std::uint8_t(frame.has_sequence));
    cdr.put(std::uint32_t(frame.n_channels));
    for (std::size_t k = 0; k < frame.n_channels; ++k) cdr.put(frame.channel[k]);
}

bool decode_frame(std::span<const char> bytes, Frame& frame) {
    CdrReader cdr(bytes);
    frame = Frame{};
    (void)cdr.get<std::int32_t>();
    (void)cdr.get<std::uint32_t>();
    frame.t_ns = cdr.get<std::uint64_t>();
    frame.device_time_us = cdr.get<std::uint64_t>();
    frame.sequence = cdr.get<std::uint32_t>();
    frame.missing = cdr.get<std::uint32_t>();
    frame.saturated = cdr.get<std::uint32_t>();
    frame.lost = cdr.get<std::uint32_t>();
    frame.device = cdr.get<std::uint16_t>();
    frame.has_sequence = cdr.get<std::uint8_t>() != 0;
    const auto channels = cdr.get<std::uint32_t>();
    if (channels > kMaxChannels) return false;
    frame.n_channels = std::uint8_t(channels);
    for (std::size_t k = 0; k < channels; ++k) frame.channel[k] = cdr.get<double>();
    return !cdr.failed();
}

}  // namespace tactiled::mcap
