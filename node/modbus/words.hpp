// The words of the registers that may be written, 5000 .. 5227, and the values that they stand for.
#pragma once
#include <array>

#include "node/modbus/encode.hpp"

namespace tactiled::modbus {

class Words {
public:
    // At the start the settings are as configured, i16 are not available, and all others are 0.
    Words() noexcept;
    [[nodiscard]] std::uint16_t& operator[](unsigned at) noexcept { return words_[at - kControlsAt]; }
    [[nodiscard]] std::uint16_t operator[](unsigned at) const noexcept { return words_[at - kControlsAt]; }
    // Returns the value of a u16 or i16: see decode().
    [[nodiscard]] double value(unsigned at) const noexcept { return decode(*writable_at(at), (*this)[at]); }

private:
    std::array<std::uint16_t, kControlsSize + kScratchSize> words_{};
};

}  // namespace tactiled::modbus
