// The wall and libmodbus behind it: any bytes as a stream. Oracles: an answer is at most 260 bytes, echoes transaction and
// unit, is as long as it says, and is a read's or write's answer or an exception; nothing is used beyond what was received.
#include "node/modbus/encode.hpp"
#include "node/modbus/identify.hpp"
#include "node/modbus/request_validator.hpp"
#include "node/modbus/responder.hpp"
#include "node/modbus/rtu.hpp"
#include "tests/fuzz/input.hpp"

using namespace tactiled;
using namespace tactiled::modbus;
using fuzz::check;

namespace {
// How long the PDU of a good answer is: 1.1b3, section 6.
std::size_t length_of_answer(const Request& r) {
    switch (r.function) {
        case kReadCoils:
        case kReadInputs: return 2u + (r.read.count + 7u) / 8;
        case kReadHolding:
        case kReadInputRegisters:
        case kReadWrite: return 2u + 2u * r.read.count;
        case kMaskWrite: return 7;
        default: return 5;
    }
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static Responder responder;
    static Tables tables;
    static const Identity identity("fuzz");
    std::array<std::uint8_t, kMaxAdu> out;
    for (std::size_t used = 0; used < size;) {
        const std::span<const std::uint8_t> rest(data + used, size - used);
        std::size_t length = 0;
        if (cut_adu(rest, length) != Cut::adu) break;
        check(length <= rest.size() && length >= 8 && length <= kMaxAdu);
        const auto adu = rest.first(length);
        const Request request = check_adu(adu, true);
        std::size_t n = 0;
        if (request.exception != kNone) {
            n = exception_adu(adu, request.exception, out);
            check(n == 9 && (out[7] & 0x80) != 0);
        } else if (request.function == kEncapsulated) {
            n = identity.answer(adu, out);
            check(n >= 9);
        } else {
            n = responder.answer(adu, tables, out);
            check(n == kMbapSize + length_of_answer(request) && out[7] == request.function);
        }
        check(n <= kMaxAdu && out[0] == adu[0] && out[1] == adu[1] && out[6] == adu[6] &&
              (out[4] << 8 | out[5]) == int(n) - 6);
        std::array<std::uint8_t, kMaxRtu> frame;
        const std::size_t bytes = rtu_of_adu(std::span(out).first(n), frame);
        std::array<std::uint8_t, kMaxAdu> back;
        check(adu_of_rtu(std::span(frame).first(bytes), back) == n &&
              std::equal(out.begin() + 6, out.begin() + long(n), back.begin() + 6));
        used += length;
    }
    (void)adu_of_rtu({data, size}, out);
    return 0;
}
