// The wall and libmodbus behind it: any bytes as a stream. Oracles: an answer is at most 260 bytes, echoes transaction and
// unit, is as long as it says, and is a read's answer or an exception; nothing is used beyond what was received.
#include <cstdlib>

#include "node/modbus/encode.hpp"
#include "node/modbus/responder.hpp"
#include "node/modbus/wall.hpp"

using namespace tactiled;
using namespace tactiled::modbus;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static Responder responder;
    static const View view = view_of_nothing();
    const auto check = [](bool holds) {
        if (!holds) std::abort();
    };
    for (std::size_t used = 0; used < size;) {
        const std::span<const std::uint8_t> rest(data + used, size - used);
        std::size_t length = 0;
        if (cut_adu(rest, length) != Cut::adu) break;
        check(length <= rest.size() && length >= 8 && length <= kMostAdu);
        const auto adu = rest.first(length);
        const Request request = check_adu(adu);
        std::array<std::uint8_t, kMostAdu> out;
        std::size_t n = 0;
        if (request.exception != kNone) {
            n = exception_adu(adu, request.exception, out);
            check(n == 9 && (out[7] & 0x80) != 0);
        } else {
            const Area* area = area_of(request.at, request.count);
            check(area != nullptr);
            std::array<std::uint16_t, kSensorSize * kSensorBlocks> registers;
            const std::span<std::uint16_t> cells(registers.data(), area->size);
            encode_area(view, *area, cells);
            n = responder.answer(adu, *area, cells, out);
            check(n == 9u + 2u * request.count && out[7] == request.function && out[8] == 2 * request.count);
            check((out[9] << 8 | out[10]) == cells[std::size_t(request.at - area->at)]);
        }
        check(n <= kMostAdu && out[0] == adu[0] && out[1] == adu[1] && out[6] == adu[6] &&
              (out[4] << 8 | out[5]) == int(n) - 6);
        used += length;
    }
    return 0;
}
