// Registers of one answer -> Frame: which numbers stand where, as the user lists them. Pure.
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

// One frame: all of it from one answer.
struct RegisterSet {
    std::uint16_t at = 0, count = 0;     // what is asked for
    std::vector<RegisterValue> channel;  // 1 .. kMaxChannels
    struct Ready {                       // no frame unless register & mask == value
        std::uint16_t at = 0, mask = 0, value = 0;
    };
    std::vector<Ready> ready;
    std::vector<RegisterValue> sequence;  // none or one, unsigned
};

// The number at `value.at` of `words`, which begin at register `first`. rt: wait-free
double register_value(const RegisterValue& value, std::span<const std::uint16_t> words, std::uint16_t first) noexcept;

// True where it is the first or last number of a signed type or the last of an unsigned one, whose first is a common zero:
// a device that clips does so there. rt: wait-free
bool register_is_saturated(const RegisterValue& value, std::span<const std::uint16_t> words, std::uint16_t first) noexcept;

// Fills channels, rails, sequence and losses of `frame`; false, and counted, where it is none: not ready, the same sample
// again, or an infinite number. rt: bounded by the channels
bool read_registers(const RegisterSet& set, std::span<const std::uint16_t> words, SequenceTracker& sequence,
                    LinkCounts& counts, Frame& frame) noexcept;

}  // namespace tactiled
