// The request validator and libmodbus behind it: any bytes as a stream. Oracles: each request gets one answer, of at most
// 260 bytes, that echoes transaction and unit, is as long as it says, and is the answer of the function that was asked for
// or an exception of the validator's; over RTU the same PDU has a correct checksum; nothing is used beyond what was
// received.
#include <algorithm>
#include <vector>

#include "node/modbus/encode.hpp"
#include "node/modbus/identify.hpp"
#include "node/modbus/request_validator.hpp"
#include "node/modbus/responder.hpp"
#include "node/modbus/rtu.hpp"
#include "tests/fuzz/input.hpp"
#include "tests/unit/modbus/answer_socket.hpp"

using namespace tactiled;
using namespace tactiled::modbus;
using fuzz::check;

namespace {
// Length of the PDU of a good answer: 1.1b3, section 6.
std::size_t length_of_answer(const Request& r, std::span<const std::uint8_t> pdu) {
    switch (r.function) {
        case kReadCoils:
        case kReadInputs: return 2u + (r.read.count + 7u) / 8;
        case kReadHolding:
        case kReadInputRegisters:
        case kReadWrite: return 2u + 2u * r.read.count;
        case kMaskWrite: return 7;
        case kDiagnostics: return pdu.size();
        default: return 5;
    }
}

// One framing, the server's end and the client's.
struct End {
    explicit End(ModbusWire wire) : responder(wire) { responder.set_descriptor(socket.fd()); }
    // The PDU of the answer, in `out`.
    std::span<const std::uint8_t> answer(std::span<const std::uint8_t> bytes, const Request& request,
                                         const Identity& identity) {
        const auto pdu = responder.pdu_of(bytes);
        std::array<std::uint8_t, kMaxPdu> own;
        std::size_t sent = 0;
        if (request.exception != kNone)
            sent = responder.refuse(bytes, request.exception);
        else if (request.function == kDiagnostics)
            sent = responder.send(bytes, pdu);
        else if (request.function == kEncapsulated || request.function == kReportServerId)
            sent = responder.send(bytes, std::span(own).first(identity.answer(pdu, true, own)));
        else
            sent = responder.reply(bytes, tables);
        taken = socket.take(out);
        check(taken == sent);
        return sent == 0 ? std::span<const std::uint8_t>{} : responder.pdu_of(std::span(out).first(taken));
    }
    test::AnswerSocket socket;
    Responder responder;
    Tables tables;
    std::array<std::uint8_t, kMaxAdu + 1> out{};
    std::size_t taken = 0;
};
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static End tcp(ModbusWire::tcp), rtu(ModbusWire::rtu);
    static const Identity identity("fuzz");
    for (std::size_t used = 0; used < size;) {
        const std::span<const std::uint8_t> rest(data + used, size - used);
        std::size_t length = 0;
        if (cut_adu(rest, length) != Cut::adu) break;
        check(length <= rest.size() && length >= 8 && length <= kMaxAdu);
        // On the heap, and no longer than it is: the sanitizer sees who reads beyond its end.
        const std::vector<std::uint8_t> adu(rest.begin(), rest.begin() + long(length));
        const auto pdu = tcp.responder.pdu_of(adu);
        const Request request = check_pdu(pdu, true);
        const auto answer = tcp.answer(adu, request, identity);
        check(answer.size() >= 2 && tcp.taken <= kMaxAdu);
        if (request.exception != kNone)
            check(answer.size() == 2 && answer[0] == (request.function | 0x80) && answer[1] == request.exception);
        else if (request.function == kEncapsulated || request.function == kReportServerId)
            check(answer[0] == request.function);
        else
            check(answer[0] == request.function && answer.size() == length_of_answer(request, pdu));
        const auto& out = tcp.out;
        check(out[0] == adu[0] && out[1] == adu[1] && out[2] == 0 && out[3] == 0 && out[6] == adu[6] &&
              (out[4] << 8 | out[5]) == int(tcp.taken) - 6);

        std::vector<std::uint8_t> frame(adu.begin() + 6, adu.end());
        frame.insert(frame.end(), {0, 0});  // its checksum was verified before
        const auto same = rtu.answer(frame, request, identity);
        if (adu[6] == 0)
            check(same.empty());
        else
            check(std::equal(same.begin(), same.end(), answer.begin(), answer.end()) && rtu.out[0] == adu[6] &&
                  is_rtu_frame(std::span(rtu.out).first(rtu.taken)));
        used += length;
    }
    (void)is_rtu_frame({data, size});
    return 0;
}
