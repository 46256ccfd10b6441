// The text wire format: a line of numbers, as an Arduino prints it. ascii_line.md defines it.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/wire/delimited.hpp"
#include "drivers/wire/sequence_tracker.hpp"

namespace tactiled {

inline constexpr std::size_t kAsciiMaxBytes = 512;  // limit of a line

struct AsciiFormat {
    unsigned channels = 1;
    bool checksum = false;  // required, by exclusive or if it is not crc16; a checksum that is present is always checked
    bool sequence = false;  // the first column is a counter, modulo 2^32
    bool time_us = false;   // the next column is the device's clock, microseconds modulo 2^32
    bool crc16 = false;     // the checksum is the CRC of the binary frames, which is required then
};

class AsciiDecoder final : public LineDecoder<kAsciiMaxBytes> {
public:
    AsciiDecoder(const AsciiFormat& format, LinkCounts& counts) : LineDecoder(counts), format_(format) {}
    void reset() noexcept override;
    std::string freshness() const override;
    std::string advice() const override;
    bool has_echo() const noexcept override { return true; }

private:
    bool read_line(std::string_view line, Frame& frame) noexcept override;
    bool read_echo(std::string_view line) noexcept;
    bool read_cells(std::string_view line, Frame& frame) noexcept;

    AsciiFormat format_;
    SequenceTracker sequence_;
    CounterWidth width_;
    std::uint64_t time_us_ = 0;
    bool time_seen_ = false;
};

// Writes the line that a device prints for `frame`, with each channel as the shortest decimal that reads back to the
// same double. Returns the number of bytes, including "
// ". For tests and for `tactilectl play`.
std::size_t encode_ascii(const Frame& frame, const AsciiFormat& format, std::span<char, kAsciiMaxBytes * 2> out) noexcept;

}  // namespace tactiled
