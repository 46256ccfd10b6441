// All stream decoders, and a Modbus master's answers. The first byte chooses the format and the size of the chunks.
// Oracles: the same frames whatever the chunks; a frame's channels are finite or marked missing; every frame of the binary
// format survives being encoded and decoded again; bytes in = bytes counted. A Modbus answer is the same whatever the
// chunks, and what it holds stands in the bytes under a right CRC or our transaction.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "drivers/wire/ft300_frame.hpp"
#include "drivers/wire/kms40_line.hpp"
#include "drivers/wire/modbus_message.hpp"

namespace {

using namespace tactiled;

void check(bool holds) {
    if (!holds) std::abort();
}

enum class Format { lines, cobs, ft300, kms40, modbus_rtu, modbus_tcp, formats };

std::vector<Frame> decode(Format format, std::span<const std::uint8_t> bytes, std::size_t chunk) {
    LinkCounts counts;
    std::unique_ptr<StreamDecoder> decoder;
    if (format == Format::cobs)
        decoder = std::make_unique<CobsDecoder>(counts);
    else if (format == Format::kms40)
        decoder = std::make_unique<Kms40Decoder>(counts);
    else if (format == Format::ft300)
        decoder = std::make_unique<Ft300Decoder>(std::uint8_t(9), counts);
    else
        decoder = std::make_unique<AsciiDecoder>(AsciiFormat{3, false, true, true}, counts);
    std::vector<Frame> frames;
    Frame frame;
    for (std::size_t at = 0; at < bytes.size(); at += chunk) {
        decoder->push(bytes.subspan(at, std::min(chunk, bytes.size() - at)), 1);
        while (decoder->next(frame)) frames.push_back(frame);
    }
    check(counts[TACTILED_LINK_BYTES] == std::uint32_t(bytes.size()));
    check(counts[TACTILED_LINK_FRAMES] == frames.size());
    check(counts[TACTILED_LINK_SKIPPED] <= bytes.size());
    return frames;
}

bool same(const Frame& a, const Frame& b) {
    for (unsigned k = 0; k < a.n_channels; ++k)
        if (std::memcmp(&a.channel[k], &b.channel[k], sizeof a.channel[k]) != 0) return false;
    return a.sequence == b.sequence && a.n_channels == b.n_channels && a.missing == b.missing &&
           a.saturated == b.saturated && a.device == b.device && a.device_time_us == b.device_time_us;
}

const ModbusRequest kAsked{.transaction = 0x2020, .unit = 9, .function = 3, .at = 180, .count = 2};

// What next() said last, and the registers that were taken as the answer.
struct Taken {
    int found = 0;
    std::vector<std::uint16_t> registers;
    bool operator==(const Taken&) const = default;
};

Taken answer_in(ModbusWire wire, std::span<const std::uint8_t> bytes, std::size_t chunk) {
    ModbusAnswers answers(wire);
    answers.expect(kAsked);
    for (std::size_t at = 0; at < bytes.size();) {
        const auto room = answers.room();
        check(room.size() >= 260);
        const std::size_t n = std::min({chunk, bytes.size() - at, room.size()});
        std::memcpy(room.data(), bytes.data() + at, n);
        answers.took(n);
        at += n;
        const auto found = answers.next();
        check(answers.skipped <= bytes.size());
        if (found == ModbusAnswers::Found::nothing) continue;
        if (found != ModbusAnswers::Found::good) return {int(found), {}};
        return {int(found), {answers.registers().begin(), answers.registers().end()}};
    }
    return {};
}

void check_answers(ModbusWire wire, std::span<const std::uint8_t> bytes, std::size_t chunk) {
    const Taken whole = answer_in(wire, bytes, bytes.size() + 1);
    check(whole == answer_in(wire, bytes, chunk));
    if (whole.registers.empty()) return;
    check(whole.registers.size() == kAsked.count);
    std::vector<std::uint8_t> message{9, 3, 4};
    for (const std::uint16_t word : whole.registers) {
        message.push_back(std::uint8_t(word >> 8));
        message.push_back(std::uint8_t(word));
    }
    if (wire == ModbusWire::rtu) {
        const std::uint16_t crc = modbus_crc(message);
        message.push_back(std::uint8_t(crc));
        message.push_back(std::uint8_t(crc >> 8));
    } else {
        message.insert(message.begin(), {0x20, 0x20, 0, 0, 0, 7});
    }
    check(std::search(bytes.begin(), bytes.end(), message.begin(), message.end()) != bytes.end());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 1) return 0;
    const auto format = Format(data[0] % int(Format::formats));
    const std::size_t chunk = 1u + data[0] / unsigned(Format::formats);
    const std::span<const std::uint8_t> bytes(data + 1, size - 1);
    if (format == Format::modbus_rtu || format == Format::modbus_tcp) {
        check_answers(format == Format::modbus_rtu ? ModbusWire::rtu : ModbusWire::tcp, bytes, chunk);
        return 0;
    }
    const auto whole = decode(format, bytes, StreamDecoder::kMostBytes);
    const auto cut = decode(format, bytes, chunk);
    check(whole.size() == cut.size());
    for (std::size_t i = 0; i < whole.size(); ++i) {
        check(same(whole[i], cut[i]));
        const Frame& f = whole[i];
        check(f.n_channels >= 1 && f.n_channels <= kMaxChannels);
        for (unsigned k = 0; k < f.n_channels; ++k) check(std::isfinite(f.channel[k]) != ((f.missing >> k & 1u) != 0));
        if (format != Format::cobs) continue;
        std::array<std::uint8_t, kCobsMostEncoded> again;
        const std::size_t n = encode_cobs(f, 32, again);
        const auto back = decode(Format::cobs, {again.data(), n}, StreamDecoder::kMostBytes);
        check(back.size() == 1 && back[0].sequence == f.sequence && back[0].n_channels == f.n_channels);
        for (unsigned k = 0; k < f.n_channels; ++k) check((f.missing >> k & 1u) != 0 || back[0].channel[k] == f.channel[k]);
    }
    return 0;
}
