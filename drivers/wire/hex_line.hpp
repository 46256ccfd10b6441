// A line of hexadecimal numbers of fixed width without separators, as Wacoh's DynPick prints it:
//
//     3 2013 1FFA 2100 2000 2001 1FFF    written together: a decimal digit, six unsigned numbers of 4 digits, end of line
//
// From public drivers of the product; tested against a simulated device only. The format has no checksum. Damage
// shows only in the line's length, in a letter that is not a digit, or in a number above the converter's last code.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "drivers/wire/delimited.hpp"

namespace tactiled {

struct HexFormat {
    unsigned channels = 6, digits = 4;  // number of channels; digits of each, 1 .. 8
    enum class Digit {
        none,
        ignored,
        counter
    } first = Digit::none;       // a decimal digit before the numbers; a counter runs from 0 to 9
    std::uint32_t max = 0xFFFF;  // the converter's last code; 0 and this code are saturation limits
    std::string start, stop;     // bytes that start and stop the stream of the device
};

inline constexpr std::size_t kHexMaxLine = 1 + kMaxChannels * 8 + 1;  // including the carriage return

class HexDecoder final : public LineDecoder<kHexMaxLine> {
public:
    HexDecoder(HexFormat format, LinkCounts& counts) : LineDecoder(counts), format_(std::move(format)) {}
    void reset() noexcept override;
    [[nodiscard]] std::span<const std::uint8_t> start_bytes() const noexcept override { return bytes_of(format_.start); }
    [[nodiscard]] std::span<const std::uint8_t> stop_bytes() const noexcept override { return bytes_of(format_.stop); }

private:
    static std::span<const std::uint8_t> bytes_of(const std::string& text) noexcept {
        return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
    }
    bool read_line(std::string_view line, Frame& frame) noexcept override;
    bool count_on(unsigned digit, Frame& frame) noexcept;

    HexFormat format_;
    bool counted_ = false;  // `counter_` is of a line since reset()
    std::uint32_t counter_ = 0;
    unsigned digit_ = 0;  // digit of that line: 10 does not divide 2^32
};

}  // namespace tactiled
