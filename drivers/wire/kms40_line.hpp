// The text stream of Weiss' KMS 40 (TCP, port 1000): "F={fx,fy,fz,mx,my,mz},time", N and Nm, after "L1()". The
// sources (public drivers) do not state the unit of the time, so it is checked to be a number and not used. The
// stream has no counter and no checksum; TCP has a checksum. Tested against a simulated device only.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/wire/delimited.hpp"

namespace tactiled {

class Kms40Decoder final : public LineDecoder<256> {
public:
    using LineDecoder::LineDecoder;
    [[nodiscard]] std::span<const std::uint8_t> start_bytes() const noexcept override;
    [[nodiscard]] std::span<const std::uint8_t> stop_bytes() const noexcept override;

private:
    bool read_line(std::string_view line, Frame& frame) noexcept override;
};

}  // namespace tactiled
