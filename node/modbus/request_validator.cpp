#include "node/modbus/request_validator.hpp"

#include "node/modbus/table.hpp"

namespace tactiled::modbus {
namespace {

std::uint16_t word(std::span<const std::uint8_t> bytes, std::size_t at) noexcept {
    return std::uint16_t(bytes[at] << 8 | bytes[at + 1]);
}

bool in(unsigned count, unsigned max) noexcept { return count >= 1 && count <= max; }

bool is_readable(Run run, std::uint8_t function, bool scratch) noexcept {
    bool has_area = false;
    for (const Area& area : areas_in(run.at, run.count)) {
        if (area.block == Block::scratch && !scratch) continue;
        if (area.is_latched() && area_of(run.at, run.count) == nullptr) return false;
        if (area.is_holding_only() && function == kReadInputRegisters) return false;
        has_area = true;
    }
    return has_area;
}

bool is_writable(Run run, bool scratch) noexcept {
    const Area* const area = area_of(run.at, run.count);
    if (area == nullptr) return false;
    if (area->block == Block::scratch) return scratch;
    for (unsigned i = 0; i < run.count; ++i)
        if (writable_at(run.at + i) == nullptr) return false;
    return true;
}

}  // namespace

Cut cut_adu(std::span<const std::uint8_t> bytes, std::size_t& size) noexcept {
    // Each field is checked as soon as it is received, so that an invalid stream is closed without waiting for the
    // rest.
    if (bytes.size() >= 4 && word(bytes, 2) != 0) return Cut::close;
    if (bytes.size() < 6) return Cut::more;
    const std::size_t length = word(bytes, 4);  // unit identifier and PDU: 1 + 1 .. 253 bytes
    if (length < 2 || length > kMaxAdu - 6) return Cut::close;
    size = 6 + length;
    return bytes.size() < size ? Cut::more : Cut::adu;
}

Request check_pdu(std::span<const std::uint8_t> pdu, bool scratch) noexcept {
    Request request;
    const std::size_t size = pdu.size();
    request.function = pdu[0];
    const auto refuse = [&](Exception exception) {
        request.exception = exception;
        return request;
    };
    const auto run = [&](std::size_t at) { return Run{word(pdu, at), word(pdu, at + 2)}; };
    // Checks that the write has `bytes` data bytes after the byte count at `at`, as the byte count and the quantity
    // require.
    const auto holds = [&](std::size_t at, std::size_t bytes) { return pdu[at] == bytes && size == at + 1 + bytes; };
    switch (pdu[0]) {
        case kReadCoils:
        case kReadInputs:
            if (size != 5 || !in(word(pdu, 3), kMaxReadBits)) return refuse(kIllegalValue);
            request.read = run(1);
            if (request.read.at + request.read.count > (pdu[0] == kReadCoils ? kCoils : kInputs))
                return refuse(kIllegalAddress);
            return request;
        case kReadHolding:
        case kReadInputRegisters:
            if (size != 5 || !in(word(pdu, 3), kMaxRead)) return refuse(kIllegalValue);
            request.read = run(1);
            if (!is_readable(request.read, pdu[0], scratch)) return refuse(kIllegalAddress);
            return request;
        case kWriteCoil:
            if (size != 5 || (word(pdu, 3) != 0 && word(pdu, 3) != 0xFF00)) return refuse(kIllegalValue);
            request.write = {word(pdu, 1), 1};
            request.written = pdu.subspan(3, 1);  // 0xFF: its lowest bit is the coil
            if (request.write.at >= kCoils) return refuse(kIllegalAddress);
            return request;
        case kWriteRegister:
        case kMaskWrite:
            if (size != (pdu[0] == kMaskWrite ? 7u : 5u)) return refuse(kIllegalValue);
            request.write = {word(pdu, 1), 1};
            request.written = pdu.subspan(3);  // the value, or AND mask and OR mask
            if (!is_writable(request.write, scratch)) return refuse(kIllegalAddress);
            return request;
        case kWriteCoils:
            if (size < 6 || !in(word(pdu, 3), kMaxWriteBits) || !holds(5, (word(pdu, 3) + 7u) / 8))
                return refuse(kIllegalValue);
            request.write = run(1);
            request.written = pdu.subspan(6);
            if (request.write.at + request.write.count > kCoils) return refuse(kIllegalAddress);
            return request;
        case kWriteRegisters:
            if (size < 6 || !in(word(pdu, 3), kMaxWrite) || !holds(5, 2u * word(pdu, 3))) return refuse(kIllegalValue);
            request.write = run(1);
            request.written = pdu.subspan(6);
            if (!is_writable(request.write, scratch)) return refuse(kIllegalAddress);
            return request;
        case kReadWrite:
            if (size < 10 || !in(word(pdu, 3), kMaxRead) || !in(word(pdu, 7), kMaxWriteBeside) ||
                !holds(9, 2u * word(pdu, 7)))
                return refuse(kIllegalValue);
            request.read = run(1);
            request.write = run(5);
            request.written = pdu.subspan(10);
            if (!is_readable(request.read, pdu[0], scratch) || !is_writable(request.write, scratch))
                return refuse(kIllegalAddress);
            return request;
        case kDiagnostics:  // only "return query data", with any number of words
            if (size < 3) return refuse(kIllegalValue);
            if (word(pdu, 1) != 0) return refuse(kIllegalFunction);
            return size < 5 || size % 2 == 0 ? refuse(kIllegalValue) : request;
        case kReportServerId: return size != 1 ? refuse(kIllegalValue) : request;
        case kEncapsulated:
            if (size < 2 || pdu[1] != kReadIdentity) return refuse(kIllegalFunction);
            if (size != 4 || pdu[2] < kBasic || pdu[2] > kIndividual) return refuse(kIllegalValue);
            return pdu[2] == kIndividual && pdu[3] >= kIdentityObjects ? refuse(kIllegalAddress) : request;
        default: return refuse(kIllegalFunction);
    }
}

}  // namespace tactiled::modbus
