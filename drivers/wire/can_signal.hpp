// One signal of a CAN message, as a DBC file describes it: bytes -> number, pure.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace tactiled {

inline constexpr std::size_t kCanMaxBytes = 64;  // of a CAN FD message

struct CanSignal {
    enum class Order : std::uint8_t { intel, motorola };
    enum class Type : std::uint8_t { is_unsigned, is_signed, is_float };  // a float has 32 or 64 bits

    // DBC's numbering: bit n of byte k is 8 k + n, n = 0 the least significant. `start` is the signal's least significant
    // bit with Intel order, its most significant with Motorola, from where it runs on from bit 0 of a byte to bit 7 of the
    // next.
    unsigned start = 0, length = 1;
    Order order = Order::intel;
    Type type = Type::is_unsigned;
    double factor = 1, offset = 0;

    bool operator==(const CanSignal&) const = default;
};

// "" where the signal is one and lies in a message of `bytes`, else what is wrong: more than 64 bytes come in several frames
// (isotp.hpp). setup
std::string why_no_signal(const CanSignal& signal, std::size_t bytes);

// Number of bytes that a message must have to hold the signal. rt: wait-free
[[nodiscard]] std::size_t bytes_needed(const CanSignal& signal) noexcept;

// The signal's bits as they are sent, in the low ones. `bytes` has bytes_needed() or more. rt: wait-free
[[nodiscard]] std::uint64_t raw_of(const CanSignal& signal, std::span<const std::uint8_t> bytes) noexcept;

// The signal's number: raw, by its type, * factor + offset. Exact where factor is 1, offset 0 and the integer below 2^53.
// rt: wait-free
[[nodiscard]] double value_of(const CanSignal& signal, std::span<const std::uint8_t> bytes) noexcept;

}  // namespace tactiled
