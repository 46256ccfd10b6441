// The binary wire format: COBS, CRC-16, sequence, device time, 24- or 32-bit channels. Its definition: cobs_frame.md.
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "drivers/wire/decoder.hpp"

namespace tactiled {

inline constexpr std::size_t kCobsMostDevices = 16;
inline constexpr std::size_t kCobsMostPlain = 10 + 4 + 4 * kMaxChannels + 2;  // bytes before COBS
inline constexpr std::size_t kCobsMostEncoded = kCobsMostPlain + 1 + 1;       // with COBS' byte and the delimiter

class CobsDecoder final : public StreamDecoder {
public:
    using StreamDecoder::StreamDecoder;
    void reset() noexcept override;

private:
    bool take(std::uint8_t byte, Frame& frame) noexcept override;
    // The bytes between two delimiters. rt: bounded by kCobsMostEncoded
    bool finish(Frame& frame) noexcept;
    bool read_plain(std::span<const std::uint8_t> plain, Frame& frame) noexcept;
    bool reject(tactiled_link_count kind) noexcept;

    struct Device {
        SequenceTracker sequence;
        std::uint64_t time_us = 0;  // extended across the wraps of the 32 bits that are sent
        bool seen = false;
    };
    std::array<Device, kCobsMostDevices> devices_{};
    std::array<std::uint8_t, kCobsMostEncoded> encoded_{};
    std::size_t length_ = 0;     // bytes since the last delimiter, also those that did not fit
    bool synchronised_ = false;  // a delimiter was seen since reset()
};

// What a device sends for `frame`: channels rounded to integers and held at the rails. Returns the number of bytes, the
// delimiter included. For tests and for `tactilectl play`.
std::size_t encode_cobs(const Frame& frame, int bits, std::span<std::uint8_t, kCobsMostEncoded> out) noexcept;

}  // namespace tactiled
