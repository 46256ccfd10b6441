// The request validator: splits the bytes of a TCP connection into requests, and checks a PDU. Pure functions.
//
// Every version of libmodbus trusts the length in the header, takes missing data from the next request, and sleeps
// half a second before some exceptions. Only requests that are complete and valid by these functions are passed to
// modbus_reply().
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/wire/modbus_codes.hpp"

namespace tactiled::modbus {

inline constexpr std::size_t kIdentityObjects = 7;  // for function 43 / 14: identify.hpp

enum class Cut {
    more,   // the request is not complete yet
    adu,    // `size` bytes are one request
    close,  // not Modbus: the next request cannot be found
};

// Finds the request at the start of `bytes`. A protocol identifier that is not 0, or an invalid length: close (Guide
// 3.1.3).
Cut cut_adu(std::span<const std::uint8_t> bytes, std::size_t& size) noexcept;

struct Run {
    std::uint16_t at = 0, count = 0;
};

// A checked request, with the ranges that it reads and writes.
struct Request {
    Exception exception = kNone;  // the answer if the request is refused
    std::uint8_t function = 0;
    Run read, write;                        // registers, or coils and inputs for functions 1, 2, 5, 15
    std::span<const std::uint8_t> written;  // the bytes to write, in the order of the request
};

inline bool writes_coils(const Request& request) noexcept {
    return request.function == kWriteCoil || request.function == kWriteCoils;
}
// Returns coil number i of a run that is to be written.
inline bool is_set(const Request& request, unsigned i) noexcept { return (request.written[i / 8] >> i % 8 & 1) != 0; }

// Checks the PDU of a whole request, at least 1 byte: function, length, quantity, address (Modbus Application Protocol
// 1.1b3, section 6, in the order of its state diagrams: function, then quantity, then address). Controls decides whether a
// value may be written. The scratch area exists only if `scratch` is true. The PDU must outlive the result.
Request check_pdu(std::span<const std::uint8_t> pdu, bool scratch) noexcept;

}  // namespace tactiled::modbus
