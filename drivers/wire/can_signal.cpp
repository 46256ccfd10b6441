#include "drivers/wire/can_signal.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

namespace tactiled {
namespace {

// Returns the first bit of a Motorola signal in the message as one row of bits, with the most significant bit of the
// first byte first.
constexpr std::size_t row_of(unsigned start) noexcept { return start / 8 * 8 + (7 - start % 8); }

}  // namespace

std::string why_no_signal(const CanSignal& signal, std::size_t bytes) {
    if (signal.length < 1 || signal.length > 64) return fmt::format("length {} is outside 1 .. 64 bits", signal.length);
    if (signal.type == CanSignal::Type::is_float && signal.length != 32 && signal.length != 64)
        return fmt::format("a float has 32 or 64 bits, not {}", signal.length);
    const std::size_t max = std::max(bytes, kCanMaxBytes);
    if (signal.start >= 8 * max) return fmt::format("start bit {} is outside 0 .. {}", signal.start, 8 * max - 1);
    if (!std::isfinite(signal.factor) || signal.factor == 0)
        return fmt::format("factor {} makes no number of it; a factor is finite and not 0", signal.factor);
    if (!std::isfinite(signal.offset)) return "the offset is not finite";
    if (const std::size_t needed = bytes_needed(signal); needed > bytes)
        return fmt::format("{} bits from start bit {} ({}) need {} bytes, but the message has {}", signal.length,
                           signal.start, signal.order == CanSignal::Order::intel ? "Intel" : "Motorola", needed, bytes);
    return "";
}

std::size_t bytes_needed(const CanSignal& signal) noexcept {
    const std::size_t first = signal.order == CanSignal::Order::intel ? signal.start : row_of(signal.start);
    return (first + signal.length + 7) / 8;
}

std::uint64_t raw_of(const CanSignal& signal, std::span<const std::uint8_t> bytes) noexcept {
    assert(bytes.size() >= bytes_needed(signal));
    std::uint64_t raw = 0;
    if (signal.order == CanSignal::Order::intel) {
        unsigned done = 0;
        for (std::size_t at = signal.start; done < signal.length; at = at / 8 * 8 + 8) {
            const auto skip = unsigned(at % 8);
            const auto part = std::uint64_t(bytes[at / 8]) >> skip;
            raw |= part << done;
            done += 8 - skip;
        }
    } else {
        const std::size_t first = row_of(signal.start), end = first + signal.length;
        const std::size_t last = (end - 1) / 8;
        const auto below = unsigned(8 * (last + 1) - end);  // bits of the last byte that are not the signal's
        for (std::size_t byte = first / 8; byte < last; ++byte) raw = raw << 8 | bytes[byte];
        // bits before the first are shifted out at the top or below
        raw = raw << (8 - below) | std::uint64_t(bytes[last]) >> below;
    }
    return signal.length == 64 ? raw : raw & ((std::uint64_t{1} << signal.length) - 1);
}

double value_of(const CanSignal& signal, std::span<const std::uint8_t> bytes) noexcept {
    const std::uint64_t raw = raw_of(signal, bytes);
    double number = 0;
    switch (signal.type) {
        case CanSignal::Type::is_unsigned: number = double(raw); break;
        case CanSignal::Type::is_signed: {
            const unsigned unused = 64 - signal.length;
            number = double(std::int64_t(raw << unused) >> unused);
            break;
        }
        case CanSignal::Type::is_float:
            number = signal.length == 32 ? double(std::bit_cast<float>(std::uint32_t(raw))) : std::bit_cast<double>(raw);
            break;
    }
    return number * signal.factor + signal.offset;
}

}  // namespace tactiled
