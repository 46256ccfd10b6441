// One signal of a CAN message, as a DBC file describes it. Converts bytes to a number, pure.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace tactiled {

inline constexpr std::size_t kCanMaxBytes = 64;  // payload of a CAN FD message

struct CanSignal {
    enum class Order : std::uint8_t { intel, motorola };
    enum class Type : std::uint8_t { is_unsigned, is_signed, is_float };  // a float has 32 or 64 bits

    // Numbering of DBC files: bit n of byte k is 8 k + n, n = 0 is the least significant. `start` is the signal's
    // least significant bit with Intel order, and its most significant with Motorola order, from where the signal
    // continues from bit 0 of a byte to bit 7 of the next one.
    unsigned start = 0, length = 1;
    Order order = Order::intel;
    Type type = Type::is_unsigned;
    double factor = 1, offset = 0;

    bool operator==(const CanSignal&) const = default;
};

// Returns "" if the signal is valid and is within a message of `bytes`, else the fault. More than 64 bytes are split
// into several frames (isotp.hpp). setup
std::string why_no_signal(const CanSignal& signal, std::size_t bytes);

// Returns the number of bytes that a message must have to contain the signal. rt: wait-free
[[nodiscard]] std::size_t bytes_needed(const CanSignal& signal) noexcept;

// Returns the signal's bits as sent, in the low bits. `bytes` has at least bytes_needed() bytes. rt: wait-free
[[nodiscard]] std::uint64_t raw_of(const CanSignal& signal, std::span<const std::uint8_t> bytes) noexcept;

// Returns the signal's number: raw, by its type, * factor + offset. It is exact if factor is 1, offset is 0 and the
// integer is below 2^53.
// rt: wait-free
[[nodiscard]] double value_of(const CanSignal& signal, std::span<const std::uint8_t> bytes) noexcept;

}  // namespace tactiled
