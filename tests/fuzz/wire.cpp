// All stream decoders, and a Modbus master's answers. The first byte chooses the format and the size of the chunks. A serial
// format without an oracle of its own here is still fuzzed: `any` makes each registered format from the keys of its link.
// Oracles: the same frames and echoes whatever the chunks; a frame's channels are finite or marked missing; every frame of
// the binary format survives being encoded and decoded again; bytes in = bytes counted; what is longer between two ends than
// any frame is counted. A Modbus answer is the same whatever the chunks, and what it holds stands in the bytes under a right
// CRC or our transaction.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "drivers/wire/ft300_frame.hpp"
#include "drivers/wire/hex_line.hpp"
#include "drivers/wire/kms40_line.hpp"
#include "drivers/wire/modbus_message.hpp"
#include "drivers/wire/stream_format.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using fuzz::check;

// The bodies get their frame around them here: a right checksum no fuzzer finds.
enum class Format {
    lines,
    cobs,
    ft300,
    kms40,
    modbus_rtu,
    modbus_tcp,
    cobs_body,
    ft300_body,
    modbus_body,
    hex,
    any,
    formats
};

std::uint16_t slow_crc16(std::span<const std::uint8_t> bytes) {  // CRC-16/MODBUS
    unsigned crc = 0xFFFF;
    for (const std::uint8_t byte : bytes) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? crc >> 1 ^ 0xA001 : crc >> 1;
    }
    return std::uint16_t(crc);
}

std::uint16_t slow_crc_ccitt(std::span<const std::uint8_t> bytes) {  // CRC-16/CCITT-FALSE
    unsigned crc = 0xFFFF;
    for (const std::uint8_t byte : bytes) {
        crc ^= unsigned(byte) << 8;
        for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x8000) != 0 ? (crc << 1 ^ 0x1021) & 0xFFFF : crc << 1 & 0xFFFF;
    }
    return std::uint16_t(crc);
}

using Bytes = std::vector<std::uint8_t>;

void append_word(Bytes& bytes, std::uint16_t word) {
    bytes.push_back(std::uint8_t(word & 0xFF));
    bytes.push_back(std::uint8_t(word >> 8));
}

Bytes cobs_around(Bytes body) {
    append_word(body, slow_crc_ccitt(body));
    Bytes out{0};
    std::size_t code = 0;
    for (const std::uint8_t byte : body) {
        if (byte != 0) out.push_back(byte);
        if (byte != 0 && out.size() - code < 0xFF) continue;
        out[code] = std::uint8_t(out.size() - code);
        code = out.size();
        out.push_back(0);
    }
    out[code] = std::uint8_t(out.size() - code);
    out.push_back(0);
    return out;
}

Bytes dress(Format& format, std::span<const std::uint8_t> bytes) {
    Bytes body(bytes.begin(), bytes.end());
    if (format == Format::cobs_body) {
        format = Format::cobs;
        return cobs_around(std::move(body));
    }
    if (format == Format::ft300_body) {
        format = Format::ft300;
        body.insert(body.begin(), {0x20, 0x4E});
        body.resize(14);
    } else if (format == Format::modbus_body) {
        format = Format::modbus_rtu;
    } else {
        return body;
    }
    append_word(body, slow_crc16(body));
    return body;
}

const HexFormat kHex{2, 2, HexFormat::Digit::counter, 0xBF, "", ""};

std::unique_ptr<StreamDecoder> any_decoder(std::uint8_t choice, LinkCounts& counts) {
    static const std::vector<std::string> names = StreamFormats::names();
    Problems problems;
    Options options = Options::parse_text("channels = 2\nsequence = true\ndigits = 2", "fuzz.toml", problems);
    return StreamFormats::find(names[choice % names.size()])->make(options, counts);
}

// Between two ends, the last one not counted: how many are longer than a frame may be.
std::size_t too_long(Format format, std::span<const std::uint8_t> bytes) {
    const std::uint8_t end = format == Format::cobs ? 0 : '\n';
    const std::size_t max = format == Format::cobs    ? kCobsMaxEncoded - 1
                            : format == Format::kms40 ? 256
                            : format == Format::hex   ? kHexMaxLine
                                                      : kAsciiMaxBytes;
    std::size_t n = 0;
    auto at = std::find(bytes.begin(), bytes.end(), end);  // a reader that begins inside a line counts nothing
    while (at != bytes.end()) {
        const auto next = std::find(at + 1, bytes.end(), end);
        n += next != bytes.end() && std::size_t(next - at - 1) > max;
        at = next;
    }
    return n;
}

std::vector<Frame> decode(Format format, std::span<const std::uint8_t> bytes, std::size_t chunk,
                          std::uint32_t* repeated = nullptr) {
    LinkCounts counts;
    std::unique_ptr<StreamDecoder> decoder;
    if (format == Format::any)
        decoder = any_decoder(bytes.empty() ? std::uint8_t{0} : bytes[0], counts);
    else if (format == Format::cobs)
        decoder = std::make_unique<CobsDecoder>(counts);
    else if (format == Format::kms40)
        decoder = std::make_unique<Kms40Decoder>(counts);
    else if (format == Format::ft300)
        decoder = std::make_unique<Ft300Decoder>(std::uint8_t(9), counts);
    else if (format == Format::hex)
        decoder = std::make_unique<HexDecoder>(kHex, counts);
    else
        decoder = std::make_unique<AsciiDecoder>(AsciiFormat{3, false, true, true}, counts);
    std::vector<Frame> frames;
    Frame frame;
    for (std::size_t at = 0; at < bytes.size(); at += chunk) {
        decoder->push(bytes.subspan(at, std::min(chunk, bytes.size() - at)), 1);
        while (decoder->next(frame)) {
            const StreamDecoder::Echo echo = decoder->take_echo();  // belongs to this frame, as in the driver
            frame.asked_ns = echo.number;
            frame.answered_us = echo.time_us;
            frames.push_back(frame);
        }
    }
    check(counts[TACTILED_LINK_BYTES] == std::uint32_t(bytes.size()));
    check(counts[TACTILED_LINK_FRAMES] == frames.size());
    check(counts[TACTILED_LINK_SKIPPED] <= bytes.size());
    check(format == Format::ft300 || format == Format::any || counts[TACTILED_LINK_BAD_LENGTH] >= too_long(format, bytes));
    if (repeated != nullptr) *repeated = counts[TACTILED_LINK_REPEATED];
    return frames;
}

// There is no frame without its bytes and a right CRC.
void check_ft300(const Frame& frame, std::span<const std::uint8_t> bytes) {
    bool found = false;
    for (std::size_t at = 0; !found && at + 16 <= bytes.size(); ++at) {
        const auto raw = bytes.subspan(at, 16);
        found = raw[0] == 0x20 && raw[1] == 0x4E && (raw[14] | raw[15] << 8) == slow_crc16(raw.first(14));
        for (unsigned k = 0; found && k < 6; ++k) {
            const auto count = std::int16_t(raw[2 + 2 * k] | raw[3 + 2 * k] << 8);
            found = std::abs(frame.channel[k] - count * (k < 3 ? 0.01 : 0.001)) < 1e-9;
        }
    }
    check(found);
}

// The channels of a binary frame, read from its plain bytes by the page alone.
void check_cobs(const Frame& frame, std::span<const std::uint8_t> body) {
    const std::size_t width = body[0] == 1 ? 3 : 4, first = (body[3] & 1) != 0 ? 14 : 10;
    check(frame.n_channels == body[2] && body.size() == first + width * body[2]);
    check(frame.sequence == unsigned(body[4] | body[5] << 8) && frame.device == body[1]);
    for (unsigned k = 0; k < frame.n_channels; ++k) {
        std::int64_t number = 0;
        for (std::size_t byte = width; byte-- > 0;) number = number * 256 + body[first + k * width + byte];
        const std::int64_t top = std::int64_t{1} << (8 * width - 1);
        if (number >= top) number -= 2 * top;
        if ((frame.missing >> k & 1u) != 0) continue;
        check(frame.channel[k] == double(number));
        check(((frame.saturated >> k & 1u) != 0) == (number == top - 1 || number == -top));
    }
}

// A line of the bytes, all of it, says just this.
void check_hex(const Frame& frame, std::span<const std::uint8_t> bytes) {
    std::array<char, 16> text{};
    const auto width = std::snprintf(text.data(), text.size(), "\n%u%02x%02x", frame.sequence % 10,
                                     unsigned(frame.channel[0]), unsigned(frame.channel[1]));
    std::string all = "\n";
    for (const std::uint8_t byte : bytes) all += byte >= 'A' && byte <= 'F' ? char(byte + 32) : char(byte);
    const std::string line(text.data(), std::size_t(width));
    check(all.find(line + "\n") != std::string::npos || all.find(line + "\r\n") != std::string::npos);
    for (unsigned k = 0; k < 2; ++k)
        check(frame.channel[k] <= 0xBF &&
              (frame.channel[k] == 0 || frame.channel[k] == 0xBF) == ((frame.saturated >> k & 1u) != 0));
}

void check_line(const Frame& frame) {
    std::array<char, 2 * kAsciiMaxBytes> text;
    const std::size_t n = encode_ascii(frame, {frame.n_channels, true, true, true}, text);
    LinkCounts counts;
    AsciiDecoder decoder({frame.n_channels, true, true, true}, counts);
    decoder.push({reinterpret_cast<const std::uint8_t*>(text.data()), n}, 1);
    Frame back;
    check(decoder.next(back) && back.sequence == frame.sequence && back.missing == frame.missing);
    for (unsigned k = 0; k < frame.n_channels; ++k)
        check((frame.missing >> k & 1u) != 0 || frame.channel[k] == back.channel[k]);
}

bool same(const Frame& a, const Frame& b) {
    for (unsigned k = 0; k < a.n_channels; ++k)
        if (std::memcmp(&a.channel[k], &b.channel[k], sizeof a.channel[k]) != 0) return false;
    return a.sequence == b.sequence && a.n_channels == b.n_channels && a.missing == b.missing &&
           a.saturated == b.saturated && a.device == b.device && a.device_time_us == b.device_time_us &&
           a.asked_ns == b.asked_ns && a.answered_us == b.answered_us;
}

const ModbusRequest kAsked{.transaction = 0x2020, .unit = 9, .function = 3, .at = 180, .count = 2};

// The last result of next(), and the registers that were taken as the answer.
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
    Bytes message{9, 3, 4};
    for (const std::uint16_t word : whole.registers) {
        message.push_back(std::uint8_t(word >> 8));
        message.push_back(std::uint8_t(word));
    }
    if (wire == ModbusWire::rtu) {
        append_word(message, slow_crc16(message));
    } else {
        message.insert(message.begin(), {0x20, 0x20, 0, 0, 0, 7});
    }
    check(std::search(bytes.begin(), bytes.end(), message.begin(), message.end()) != bytes.end());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 1) return 0;
    const auto as_reported = Format(data[0] % int(Format::formats));
    Format format = as_reported;
    const std::size_t chunk = 1u + data[0] / unsigned(Format::formats);
    const Bytes bytes = dress(format, {data + 1, std::min<std::size_t>(size - 1, StreamDecoder::kMaxBytes - 40)});
    if (format == Format::modbus_rtu || format == Format::modbus_tcp) {
        check_answers(format == Format::modbus_rtu ? ModbusWire::rtu : ModbusWire::tcp, bytes, chunk);
        return 0;
    }
    std::uint32_t repeated = 0;
    const auto whole = decode(format, bytes, StreamDecoder::kMaxBytes, &repeated);
    const auto cut = decode(format, bytes, chunk);
    check(whole.size() == cut.size());
    for (std::size_t i = 0; i < whole.size(); ++i) {
        check(same(whole[i], cut[i]));
        const Frame& f = whole[i];
        // An array, or contested by a second device under the name: not without frames that fit into no order.
        if (f.n_channels == 0) {
            check(format == Format::any || (f.has_sequence && i + repeated >= 2));
            continue;
        }
        check(f.n_channels <= kMaxChannels);
        for (unsigned k = 0; k < f.n_channels; ++k) check(std::isfinite(f.channel[k]) != ((f.missing >> k & 1u) != 0));
        if (format == Format::ft300) check_ft300(f, bytes);
        if (format == Format::lines) check_line(f);
        check(f.asked_ns == 0 || std::find(bytes.begin(), bytes.end(), '!') != bytes.end());
        if (format == Format::hex) check_hex(f, bytes);
        if (as_reported == Format::cobs_body) check_cobs(f, {data + 1, size - 1});
        if (format != Format::cobs) continue;
        std::array<std::uint8_t, kCobsMaxEncoded> again;
        const std::size_t n = encode_cobs(f, 32, again);
        const auto back = decode(Format::cobs, {again.data(), n}, StreamDecoder::kMaxBytes);
        check(back.size() == 1 && back[0].sequence == f.sequence && back[0].n_channels == f.n_channels);
        for (unsigned k = 0; k < f.n_channels; ++k) check((f.missing >> k & 1u) != 0 || back[0].channel[k] == f.channel[k]);
    }
    return 0;
}
