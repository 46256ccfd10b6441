#include "node/modbus/wall.hpp"

#include <algorithm>

#include "node/modbus/table.hpp"

namespace tactiled::modbus {
namespace {

std::uint16_t word(std::span<const std::uint8_t> bytes, std::size_t at) noexcept {
    return std::uint16_t(bytes[at] << 8 | bytes[at + 1]);
}

constexpr std::uint16_t kMostRead = 125, kMostWrite = 123;  // 1.1b3, 6.3 and 6.12

}  // namespace

Cut cut_adu(std::span<const std::uint8_t> bytes, std::size_t& size) noexcept {
    // Each field is judged as soon as it is there: a hopeless stream is closed without waiting for the rest of it.
    if (bytes.size() >= 4 && word(bytes, 2) != 0) return Cut::close;
    if (bytes.size() < 6) return Cut::more;
    const std::size_t length = word(bytes, 4);  // unit identifier and PDU: 1 + 1 .. 253 bytes
    if (length < 2 || length > kMostAdu - 6) return Cut::close;
    size = 6 + length;
    return bytes.size() < size ? Cut::more : Cut::adu;
}

Request check_adu(std::span<const std::uint8_t> adu) noexcept {
    Request request;
    const auto pdu = adu.subspan(kMbapSize);
    request.function = pdu[0];
    const auto refuse = [&](Exception exception) {
        request.exception = exception;
        return request;
    };
    switch (pdu[0]) {
        case 3:    // read holding registers
        case 4: {  // read input registers: the same registers
            if (pdu.size() != 5) return refuse(kIllegalValue);
            request.at = word(pdu, 1);
            request.count = word(pdu, 3);
            if (request.count == 0 || request.count > kMostRead) return refuse(kIllegalValue);
            if (area_of(request.at, request.count) == nullptr) return refuse(kIllegalAddress);
            return request;
        }
        case 6:  // write one register: nothing is writable yet
            if (pdu.size() != 5) return refuse(kIllegalValue);
            return refuse(kIllegalAddress);
        case 16: {  // write registers
            if (pdu.size() < 6) return refuse(kIllegalValue);
            const std::uint16_t count = word(pdu, 3);
            if (count == 0 || count > kMostWrite || pdu[5] != 2 * count || pdu.size() != 6u + pdu[5])
                return refuse(kIllegalValue);
            return refuse(kIllegalAddress);
        }
        default: return refuse(kIllegalFunction);
    }
}

std::size_t exception_adu(std::span<const std::uint8_t> adu, Exception exception,
                          std::span<std::uint8_t, kMostAdu> out) noexcept {
    std::copy_n(adu.begin(), kMbapSize, out.begin());
    out[4] = 0;
    out[5] = 3;
    out[7] = std::uint8_t(adu[7] | 0x80);
    out[8] = exception;
    return 9;
}

}  // namespace tactiled::modbus
