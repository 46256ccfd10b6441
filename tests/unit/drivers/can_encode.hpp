// Encodes a CAN signal bit by bit by the DBC numbering: the reference for the decoder.
#pragma once
#include <cstdint>
#include <span>

#include "drivers/wire/can_signal.hpp"

namespace tactiled::test {

inline void put_raw(const CanSignal& signal, std::uint64_t raw, std::span<std::uint8_t> bytes) {
    unsigned at = signal.start;  // bit n of byte k is 8 k + n
    for (unsigned n = 0; n < signal.length; ++n) {
        const bool intel = signal.order == CanSignal::Order::intel;
        const unsigned bit =
            intel ? n : signal.length - 1 - n;  // Intel begins with the least significant, Motorola with the most
        const auto mask = std::uint8_t(1u << at % 8);
        bytes[at / 8] = std::uint8_t((raw >> bit & 1u) != 0 ? bytes[at / 8] | mask : bytes[at / 8] & ~mask);
        if (intel)
            ++at;
        else
            at = at % 8 == 0 ? at + 15 : at - 1;  // below bit 0 comes bit 7 of the next byte
    }
}

}  // namespace tactiled::test
