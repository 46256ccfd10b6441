// A link's frame in shared memory is the published part of Frame.
#pragma once
#include <algorithm>
#include <cstddef>
#include <type_traits>

#include "drivers/frame.hpp"
#include "tactiled/layout.h"

namespace tactiled {

inline constexpr std::size_t kPublishedFrom = offsetof(Frame, t_ns);
static_assert(std::is_trivially_copyable_v<Frame> && sizeof(Frame) - kPublishedFrom == sizeof(tactiled_frame));
static_assert(offsetof(Frame, device_time_us) - kPublishedFrom == offsetof(tactiled_frame, device_time_us));
static_assert(offsetof(Frame, sequence) - kPublishedFrom == offsetof(tactiled_frame, sequence));
static_assert(offsetof(Frame, missing) - kPublishedFrom == offsetof(tactiled_frame, missing));
static_assert(offsetof(Frame, saturated) - kPublishedFrom == offsetof(tactiled_frame, saturated));
static_assert(offsetof(Frame, lost) - kPublishedFrom == offsetof(tactiled_frame, lost));
static_assert(offsetof(Frame, device) - kPublishedFrom == offsetof(tactiled_frame, device));
static_assert(offsetof(Frame, n_channels) - kPublishedFrom == offsetof(tactiled_frame, n_channels));
static_assert(offsetof(Frame, has_sequence) - kPublishedFrom == offsetof(tactiled_frame, has_sequence));
static_assert(offsetof(Frame, channel) - kPublishedFrom == offsetof(tactiled_frame, channel));
static_assert(sizeof(bool) == 1 && kMaxChannels == TACTILED_MAX_CHANNELS);

// Returns the record and its size, a multiple of 8 without the unused channels. rt: wait-free
inline const void* published_part(const Frame& frame) noexcept {
    return reinterpret_cast<const char*>(&frame) + kPublishedFrom;
}
inline std::size_t published_size(const Frame& frame) noexcept {
    return offsetof(tactiled_frame, channel) + sizeof(double) * frame.n_channels;
}

// Copies into `frame`, whose channels beyond n_channels are unchanged. An invalid number of channels is limited. rt:
// wait-free
inline void read_published(const tactiled_frame& published, Frame& frame) noexcept {
    frame.t_ns = published.t_ns;
    frame.device_time_us = published.device_time_us;
    frame.sequence = published.sequence;
    frame.missing = published.missing;
    frame.saturated = published.saturated;
    frame.lost = published.lost;
    frame.device = published.device;
    frame.has_sequence = published.has_sequence != 0;
    frame.n_channels = std::min<std::uint8_t>(published.n_channels, TACTILED_MAX_CHANNELS);
    std::copy_n(published.channel, frame.n_channels, frame.channel.begin());
}

}  // namespace tactiled
