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
inline constexpr std::size_t kMaxAdu = 260;  // Modbus Messaging Implementation Guide 1.0b, 4.2

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
    kDeviceFailure = 4,
    kBusy = 6
};

enum Function : std::uint8_t {
    kReadCoils = 1,
    kReadInputs = 2,
    kReadHolding = 3,
    kReadInputRegisters = 4,
    kWriteCoil = 5,
    kWriteRegister = 6,
    kWriteCoils = 15,
    kWriteRegisters = 16,
    kMaskWrite = 22,
    kReadWrite = 23,
    kEncapsulated = 43
};

struct Run {
    std::uint16_t at = 0, count = 0;
};

// A checked request: what it reads and what it writes, as far as it does.
struct Request {
    Exception exception = kNone;  // what to answer instead of asking libmodbus
    std::uint8_t function = 0;
    Run read, write;                        // registers, or coils and inputs for functions 1, 2, 5, 15
    std::span<const std::uint8_t> written;  // the bytes to write, as they stand in the request
};

// Coil number i of a run that is to be written.
inline bool is_set(const Request& request, unsigned i) noexcept { return (request.written[i / 8] >> i % 8 & 1) != 0; }

// Checks a whole request: function, length, quantity, address (Modbus Application Protocol 1.1b3, section 6, in the order
// of its state diagrams: function, then quantity, then address). Whether a value may be written is not looked at here.
// The scratch area is there only where `scratch` says so. The request must outlive the result.
Request check_adu(std::span<const std::uint8_t> adu, bool scratch) noexcept;

// The answer with an exception code: transaction and unit echoed. Returns its 9 bytes in `out`.
std::size_t exception_adu(std::span<const std::uint8_t> adu, Exception exception,
                          std::span<std::uint8_t, kMaxAdu> out) noexcept;

// The answer to a request that reads registers (functions 3, 4, 23), at most 125: transaction and unit echoed. Written
// here because libmodbus' way through a socket pair takes several times as long as all else that an answer needs
// (tests/bench/modbus_bench); a test compares the two byte by byte. Returns its length in `out`.
std::size_t registers_adu(std::span<const std::uint8_t> adu, std::span<const std::uint16_t> registers,
                          std::span<std::uint8_t, kMaxAdu> out) noexcept;

}  // namespace tactiled::modbus
