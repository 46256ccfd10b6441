// Converts the registers of one answer to a frame, with the places of the numbers from the configuration. Pure.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/driver.hpp"
#include "drivers/frame.hpp"
#include "drivers/wire/sequence_tracker.hpp"

namespace tactiled {

enum class RegisterType { int16, uint16, int32, uint32, float32 };

constexpr unsigned words_of(RegisterType type) noexcept {
    return type == RegisterType::int16 || type == RegisterType::uint16 ? 1 : 2;
}

struct RegisterValue {
    std::string name;
    RegisterType type = RegisterType::int16;
    bool low_word_first = false;
    std::uint16_t at = 0;
    double scale = 1;
};

// One frame: all registers are from one answer.
struct RegisterSet {
    std::uint16_t at = 0, count = 0;     // first register and number of registers of the request
    std::vector<RegisterValue> channel;  // 1 .. kMaxChannels
    struct Ready {                       // no frame unless register & mask == value
        std::uint16_t at = 0, mask = 0, value = 0;
    };
    std::vector<Ready> ready;
    std::vector<RegisterValue> sequence;  // zero or one, unsigned
};

// Returns the number at `value.at` of `words`, which begin at register `first`. rt: wait-free
double register_value(const RegisterValue& value, std::span<const std::uint16_t> words, std::uint16_t first) noexcept;

// Returns true if the value is the first or last number of a signed type, or the last of an unsigned type, where a
// device clips. The first number of an unsigned type is a common zero. rt: wait-free
bool register_is_saturated(const RegisterValue& value, std::span<const std::uint16_t> words, std::uint16_t first) noexcept;

// Fills channels, saturation, sequence and losses of `frame`. Returns false, and counts it, if there is no new frame:
// not ready, the same sample again, or an infinite number. rt: bounded by the channels
bool read_registers(const RegisterSet& set, std::span<const std::uint16_t> words, SequenceTracker& sequence,
                    LinkCounts& counts, Frame& frame) noexcept;

}  // namespace tactiled
