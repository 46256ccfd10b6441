// The binary wire format: COBS, CRC-16, sequence, device time, 24- or 32-bit channels. cobs_frame.md defines it. A link with
// an array carries the messages of array_frame.md beside these frames.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/wire/array_frame.hpp"
#include "drivers/wire/delimited.hpp"
#include "drivers/wire/sequence_tracker.hpp"

namespace tactiled {

inline constexpr std::size_t kCobsMaxDevices = 16;
inline constexpr std::size_t kCobsMaxPlain = 10 + 4 + 4 * kMaxChannels + 2;  // bytes before COBS
inline constexpr std::size_t kCobsMaxEncoded = kCobsMaxPlain + 1 + 1;        // including the COBS byte and the delimiter

class CobsDecoder final : public DelimitedDecoder<0, kCobsMaxEncoded - 1> {
public:
    // `shape`: of the arrays; {} = the link carries none. setup
    explicit CobsDecoder(LinkCounts& counts, TaxelShape shape = {});
    void reset() noexcept override;
    std::string freshness() const override {
        return "clock if its frames carry the device's time, else sequence (a pause of the device looks like a delay)";
    }

    bool has_echo() const noexcept override { return arrays_.has_value(); }
    TaxelShape taxel_shape() const noexcept override { return arrays_ ? arrays_->shape() : TaxelShape{}; }
    Taxels taxels() const noexcept override { return is_array_ ? arrays_->taxels() : Taxels{}; }

private:
    bool finish(std::span<const std::uint8_t> encoded, Frame& frame) noexcept override;
    bool take_array(std::span<const std::uint8_t> message, Frame& frame) noexcept;
    bool read_plain(std::span<const std::uint8_t> plain, std::uint32_t crc, Frame& frame) noexcept;

    struct Device {
        SequenceTracker sequence;
        std::uint64_t time_us = 0;  // extended across the wraps of the 32 bits that are sent
        bool seen = false;
    };
    std::array<Device, kCobsMaxDevices> devices_{};
    std::optional<ArrayAssembler> arrays_;
    bool is_array_ = false;            // the last frame is one
    std::vector<std::uint8_t> plain_;  // a frame without COBS
};

// Writes the bytes that a device sends for `frame`, with channels rounded to integers and limited to the saturation
// limits. Returns the number of bytes, including the delimiter. For tests and for `tactilectl play`.
std::size_t encode_cobs(const Frame& frame, int bits, std::span<std::uint8_t, kCobsMaxEncoded> out) noexcept;

// Writes `plain` as COBS with the delimiter. Returns the number of bytes, at most plain.size() + plain.size() / 254 + 2. For
// tests and tools.
std::size_t put_cobs(std::span<const std::uint8_t> plain, std::uint8_t* out) noexcept;

}  // namespace tactiled
