// The bytes of an FT 300, for tests.
#pragma once
#include <algorithm>
#include <cmath>

#include "drivers/wire/ft300_frame.hpp"
#include "drivers/wire/modbus_message.hpp"

namespace tactiled {

// Writes the bytes that the device sends for forces in N and torques in Nm.
inline void encode_ft300(const Frame& frame, std::span<std::uint8_t, kFt300Bytes> out) noexcept {
    out[0] = 0x20;
    out[1] = 0x4E;
    for (std::size_t k = 0; k < 6; ++k) {
        const double per_unit = k < 3 ? 100 : 1000;  // per N, per Nm
        const auto number = std::int16_t(std::lround(std::clamp(frame.channel[k] * per_unit, -32768.0, 32767.0)));
        out[2 + 2 * k] = std::uint8_t(number);
        out[3 + 2 * k] = std::uint8_t(number >> 8);
    }
    const std::uint16_t crc = modbus_crc(std::span(out).first(kFt300Bytes - 2));
    out[kFt300Bytes - 2] = std::uint8_t(crc);
    out[kFt300Bytes - 1] = std::uint8_t(crc >> 8);
}

}  // namespace tactiled
