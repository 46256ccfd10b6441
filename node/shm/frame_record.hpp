// A link's frame as shared memory shows it, and back. What only the node knows (`opening`) is not shown.
#pragma once
#include <algorithm>

#include "drivers/frame.hpp"
#include "tactiled/layout.h"

namespace tactiled {

static_assert(TACTILED_MAX_CHANNELS == kMaxChannels);

// rt: wait-free
inline tactiled_frame as_published(const Frame& frame) noexcept {
    tactiled_frame out;  // not cleared: channels beyond are not copied
    out.t_ns = frame.t_ns;
    out.device_time_us = frame.device_time_us;
    out.sequence = frame.sequence;
    out.missing = frame.missing;
    out.saturated = frame.saturated;
    out.lost = frame.lost;
    out.device = frame.device;
    out.n_channels = frame.n_channels;
    out.has_sequence = frame.has_sequence ? 1 : 0;
    out.reserved = 0;
    std::copy_n(frame.channel.begin(), frame.n_channels, out.channel);
    return out;
}

// Into `frame`, whose channels beyond stay. A hostile number of channels is cut. rt: wait-free
inline void read_published(const tactiled_frame& shown, Frame& frame) noexcept {
    frame.t_ns = shown.t_ns;
    frame.device_time_us = shown.device_time_us;
    frame.sequence = shown.sequence;
    frame.missing = shown.missing;
    frame.saturated = shown.saturated;
    frame.lost = shown.lost;
    frame.device = shown.device;
    frame.has_sequence = shown.has_sequence != 0;
    frame.n_channels = std::min<std::uint8_t>(shown.n_channels, TACTILED_MAX_CHANNELS);
    std::copy_n(shown.channel, frame.n_channels, frame.channel.begin());
}

}  // namespace tactiled
