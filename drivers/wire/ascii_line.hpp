// The text wire format: a line of numbers, as an Arduino prints it. Its definition: ascii_line.md.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/wire/decoder.hpp"

namespace tactiled {

inline constexpr std::size_t kAsciiMostBytes = 512;  // of a line

struct AsciiFormat {
    unsigned channels = 1;
    bool checksum = false;  // required; a line that has one is checked in any case
    bool sequence = false;  // the first column is a counter, modulo 2^32
    bool time_us = false;   // the next column is the device's clock, microseconds modulo 2^32
};

class AsciiDecoder final : public StreamDecoder {
public:
    AsciiDecoder(const AsciiFormat& format, LinkCounts& counts) : StreamDecoder(counts), format_(format) {}
    void reset() noexcept override;

private:
    bool take(std::uint8_t byte, Frame& frame) noexcept override;
    // A line without its end. rt: bounded by kAsciiMostBytes
    bool finish(std::string_view line, Frame& frame) noexcept;
    bool read_cells(std::string_view line, Frame& frame) noexcept;
    bool reject(tactiled_link_count kind) noexcept;

    AsciiFormat format_;
    std::array<char, kAsciiMostBytes> line_{};
    std::size_t length_ = 0;     // bytes since the last line's end, also those that did not fit
    bool synchronised_ = false;  // a line's end was seen since reset()
    SequenceTracker sequence_;
    std::uint64_t time_us_ = 0;
    bool time_seen_ = false;
};

// What a device prints for `frame`, each channel as the shortest decimal that reads back to the same double. Returns the
// number of bytes, "\n" included. For tests and for `tactilectl play`.
std::size_t encode_ascii(const Frame& frame, const AsciiFormat& format, std::span<char, kAsciiMostBytes * 2> out) noexcept;

}  // namespace tactiled
