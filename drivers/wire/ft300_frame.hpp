// The stream of Robotiq's FT 150, FT 300 and FT 300-S: 16 bytes a frame, 100 frames a second, after a Modbus write
// that requests it.
//
//     0x20 0x4E, Fx Fy Fz in 0.01 N, Mx My Mz in 0.001 Nm, each 16 bits low byte first, Modbus' CRC of these 14 bytes
//
// From the stream section of the manuals; tested against a simulated device only. The stream has no counter, so a
// lost frame is not detected.
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "drivers/wire/decoder.hpp"

namespace tactiled {

inline constexpr std::size_t kFt300Bytes = 16;

class Ft300Decoder final : public ByteDecoder {
public:
    Ft300Decoder(std::uint8_t unit, LinkCounts& counts);
    void reset() noexcept override;
    [[nodiscard]] std::span<const std::uint8_t> start_bytes() const noexcept override { return start_; }
    [[nodiscard]] std::span<const std::uint8_t> stop_bytes() const noexcept override { return stop_; }

private:
    bool take(std::uint8_t byte, Frame& frame) noexcept override;
    void drop_first() noexcept;

    std::array<std::uint8_t, 11> start_;
    std::array<std::uint8_t, 50> stop_;
    std::array<std::uint8_t, kFt300Bytes> bytes_{};
    std::size_t size_ = 0;
};

}  // namespace tactiled
