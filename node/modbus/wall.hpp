// The wall in front of libmodbus: bytes of a TCP connection -> complete, checked requests. Pure functions.
//
// libmodbus answers a register request well, but every version trusts the length in the header, takes missing data from the
// next request, and sleeps half a second before some exceptions. So it sees only requests that are whole and right here;
// the wrong ones are answered by the wall itself.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

namespace tactiled::modbus {

inline constexpr std::size_t kMbapSize = 7;
inline constexpr std::size_t kMostAdu = 260;  // Modbus Messaging Implementation Guide 1.0b, 4.2

enum class Cut {
    more,   // not a whole request yet
    adu,    // `size` bytes are one
    close,  // not Modbus: no way to find the next request
};

// What stands at the start of `bytes`. Protocol identifier not 0, or a length that no request has: close (Guide 3.1.3).
Cut cut_adu(std::span<const std::uint8_t> bytes, std::size_t& size) noexcept;

enum Exception : std::uint8_t {
    kNone = 0,
    kIllegalFunction = 1,
    kIllegalAddress = 2,
    kIllegalValue = 3,
    kDeviceFailure = 4
};

struct Request {
    Exception exception = kNone;  // what to answer instead of asking libmodbus
    std::uint8_t function = 0;
    std::uint16_t at = 0, count = 0;  // registers asked for, where exception is kNone
};

// Checks a whole request: function, length, quantity, address (Modbus Application Protocol 1.1b3, section 6, in that
// order of the state diagrams: function, then quantity, then address).
Request check_adu(std::span<const std::uint8_t> adu) noexcept;

// The answer with an exception code: transaction and unit echoed. Returns its 9 bytes in `out`.
std::size_t exception_adu(std::span<const std::uint8_t> adu, Exception exception,
                          std::span<std::uint8_t, kMostAdu> out) noexcept;

}  // namespace tactiled::modbus
