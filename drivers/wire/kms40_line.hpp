// The text stream of Weiss' KMS 40 (TCP, port 1000): "F={fx,fy,fz,mx,my,mz},time", N and Nm, after "L1()". The time's unit
// is not in the sources (public drivers), so it is checked to be a number and not used; there is no counter and no checksum:
// TCP has one. Tried against a simulated device only.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/wire/decoder.hpp"

namespace tactiled {

class Kms40Decoder final : public StreamDecoder {
public:
    using StreamDecoder::StreamDecoder;
    void reset() noexcept override;
    [[nodiscard]] std::span<const std::uint8_t> start_bytes() const noexcept override;
    [[nodiscard]] std::span<const std::uint8_t> stop_bytes() const noexcept override;

private:
    bool take(std::uint8_t byte, Frame& frame) noexcept override;
    bool read_line(std::string_view line, Frame& frame) noexcept;

    std::array<char, 256> line_{};
    std::size_t length_ = 0;  // bytes since the last line's end, also those that did not fit
};

}  // namespace tactiled
