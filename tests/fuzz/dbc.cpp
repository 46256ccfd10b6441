// A DBC file and a message. Oracles: a file that is accepted is printed and read back to the same; each of its signals reads
// what was put there bit by bit, and nothing beyond the bytes that it says it needs; assembled frames are whole.
#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "drivers/wire/can_sample.hpp"
#include "drivers/wire/dbc.hpp"
#include "tests/fuzz/input.hpp"
#include "tests/unit/drivers/can_encode.hpp"

namespace {

using namespace tactiled;
using fuzz::check;

std::string text_of(const Dbc& dbc) {
    std::string text, types;
    for (const auto& m : dbc.messages) {
        const std::uint32_t id = m.extended ? m.id | kCanExtended : m.id;
        text += fmt::format("BO_ {} {}: {} X\n", id, m.name, m.bytes);
        for (const auto& s : m.signals) {
            const CanSignal& c = s.signal;
            std::string mux = s.mux ? fmt::format("m{}", *s.mux) : "";
            if (s.selects) mux = "M";
            text += fmt::format(" SG_ {} {}: {}|{}@{}{} ({},{})\n", s.name, mux, c.start, c.length,
                                c.order == CanSignal::Order::intel ? 1 : 0, c.type == CanSignal::Type::is_signed ? '-' : '+',
                                c.factor, c.offset);
            if (c.type == CanSignal::Type::is_float)
                types += fmt::format("SIG_VALTYPE_ {} {} : {};\n", id, s.name, c.length == 32 ? 1 : 2);
        }
        if (m.nested_mux_line != 0) types += fmt::format("SG_MUL_VAL_ {} x y 0-0;\n", id);
    }
    return text + types;
}

void decode(const CanSignal& signal, std::span<const std::uint8_t> seed) {
    std::uint8_t bytes[kCanMaxBytes] = {};
    std::memcpy(bytes, seed.data(), std::min(seed.size(), sizeof bytes));
    std::uint64_t raw = 0;
    std::memcpy(&raw, bytes, sizeof raw);
    test::put_raw(signal, raw, bytes);
    const std::size_t needed = bytes_needed(signal);
    const std::vector<std::uint8_t> exactly(bytes, bytes + needed);  // the sanitizer sees a byte too far
    check(raw_of(signal, exactly) == (signal.length == 64 ? raw : raw & ((1ull << signal.length) - 1)));
    if (signal.type == CanSignal::Type::is_float) return;
    auto number = __int128(raw_of(signal, exactly));
    if (signal.type == CanSignal::Type::is_signed && number >> (signal.length - 1) != 0)
        number -= __int128(1) << signal.length;
    check(value_of(signal, exactly) == double(number) * signal.factor + signal.offset || std::isnan(signal.factor * 0));
}

// All signals of a message as one device, the messages in a row as its parts.
void assemble(const Dbc& dbc, std::span<const std::uint8_t> seed) {
    CanDevice device;
    device.window_ns = 1000;
    for (const auto& m : dbc.messages) {
        if (m.bytes > kCanMaxBytes || m.signals.empty() || device.n_channels == kMaxChannels) continue;
        CanPart part;
        part.id = m.extended ? m.id | kCanExtended : m.id;
        for (const auto& s : m.signals) {
            if (device.n_channels == kMaxChannels) break;
            part.channels.push_back({device.n_channels++, s.signal});
            part.bytes = std::max(part.bytes, bytes_needed(s.signal));
        }
        device.parts.push_back(part);
    }
    if (device.parts.empty()) return;
    const auto parts = device.parts;
    LinkCounts counts;
    CanSamples samples({device}, counts);
    std::uint64_t t_ns = 1;
    std::uint32_t frames = 0;
    Frame frame;
    for (std::size_t k = 0; k + 1 < seed.size(); k += 2) {
        t_ns += seed[k + 1];
        const auto bytes = seed.subspan(k, std::min<std::size_t>(kCanMaxBytes, seed.size() - k));
        samples.take({parts[seed[k] % parts.size()].id, bytes, t_ns});
        while (samples.next(frame)) {
            ++frames;
            check(frame.n_channels == device.n_channels && frame.t_ns <= t_ns && frame.t_ns + device.window_ns >= t_ns);
            for (unsigned c = 0; c < frame.n_channels; ++c)
                check(std::isfinite(frame.channel[c]) != ((frame.missing >> c & 1u) != 0));
        }
    }
    check(counts[TACTILED_LINK_FRAMES] == frames);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Problems problems;
    const Dbc dbc = parse_dbc({reinterpret_cast<const char*>(data), size}, "fuzz.dbc", problems);
    (void)problems.lines();
    if (!problems.empty()) return 0;
    const std::string text = text_of(dbc);
    Problems again;
    const Dbc back = parse_dbc(text, "again.dbc", again);
    check(again.empty() && back.messages == dbc.messages);
    const std::span<const std::uint8_t> seed(data, size);
    for (const auto& message : dbc.messages)
        for (const auto& signal : message.signals)
            if (message.bytes <= kCanMaxBytes) decode(signal.signal, seed);
    assemble(dbc, seed);
    return 0;
}
