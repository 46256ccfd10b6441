// Registers of a Modbus device as a frame. Oracle: another program's reading of the same bytes, written without
// looking at how ours does it: values, saturated and missing ones, what is refused, and what a counter says was lost.
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "drivers/wire/register_set.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using fuzz::check;
using fuzz::Input;

RegisterValue read_value(Input& input, std::uint16_t at, std::uint16_t count) {
    RegisterValue value;
    const std::uint8_t what = input.byte();
    value.type = RegisterType(what % 5);
    value.low_word_first = (what & 0x40) != 0;
    value.at = std::uint16_t(at + input.byte() % (count - words_of(value.type) + 1));
    value.scale = (what & 0x80) != 0 ? 0.01 : 1;
    return value;
}

struct Number {
    double value;
    bool at_rail;
};

Number slow(const RegisterValue& value, const std::vector<std::uint16_t>& words, std::uint16_t first) {
    const auto low = std::size_t(value.at - first);
    std::int64_t bits = words[low];
    if (words_of(value.type) == 2)
        bits = value.low_word_first ? words[low] + 65536LL * words[low + 1] : words[low + 1] + 65536LL * words[low];
    const auto number = [&](std::int64_t min, std::int64_t max, bool is_signed) {
        const std::int64_t n = is_signed && bits > max ? bits - (max - min + 1) : bits;
        return Number{double(n) * value.scale, n == max || (is_signed && n == min)};
    };
    if (value.type == RegisterType::int16) return number(-32768, 32767, true);
    if (value.type == RegisterType::uint16) return number(0, 65535, false);
    if (value.type == RegisterType::int32) return number(-2147483648LL, 2147483647LL, true);
    if (value.type == RegisterType::uint32) return number(0, 4294967295LL, false);
    const std::int64_t exponent = bits >> 23 & 0xFF, fraction = bits & 0x7FFFFF;
    double n =
        exponent == 0 ? std::ldexp(double(fraction), -149) : std::ldexp(double(fraction + 0x800000), int(exponent) - 150);
    if (exponent == 255) n = fraction == 0 ? std::numeric_limits<double>::infinity() : NAN;
    return {((bits >> 31) != 0 ? -n : n) * value.scale, false};
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 8) return 0;
    Input input(data, size);
    RegisterSet set;
    set.at = std::uint16_t(input.number(2) % 60000);
    set.count = std::uint16_t(2 + input.byte() % 124);
    for (unsigned n = 1 + input.byte() % kMaxChannels; n > 0; --n)
        set.channel.push_back(read_value(input, set.at, set.count));
    for (unsigned n = input.byte() % 3; n > 0; --n)
        set.ready.push_back({std::uint16_t(set.at + input.byte() % set.count), input.byte(), input.byte()});
    if (input.byte() % 2 == 0) {
        RegisterValue counter = read_value(input, set.at, set.count);
        counter.type = words_of(counter.type) == 1 ? RegisterType::uint16 : RegisterType::uint32;
        set.sequence.push_back(counter);
    }
    SequenceTracker tracker;
    LinkCounts counts;
    std::uint32_t reported = 0, refused = 0, turns = 0;
    for (; turns < 4 && (turns == 0 || !input.is_empty()); ++turns) {
        std::vector<std::uint16_t> words;  // exact number of words: the sanitizer sees one too far
        for (unsigned n = 0; n < set.count; ++n) words.push_back(std::uint16_t(input.number(2)));
        bool is_ready = true, is_finite = true;
        for (const auto& ready : set.ready) is_ready &= (words[std::size_t(ready.at - set.at)] & ready.mask) == ready.value;
        for (const auto& channel : set.channel) is_finite &= !std::isinf(slow(channel, words, set.at).value);
        Frame frame;
        if (!read_registers(set, words, tracker, counts, frame)) {
            ++refused;
            check(!is_ready || !is_finite || !set.sequence.empty());
            continue;
        }
        check(is_ready && is_finite && frame.n_channels == set.channel.size());
        reported += frame.lost;
        for (unsigned k = 0; k < frame.n_channels; ++k) {
            const Number expected = slow(set.channel[k], words, set.at);
            check(std::isnan(expected.value) == ((frame.missing >> k & 1) != 0));
            check(std::isnan(expected.value) || expected.value == frame.channel[k]);
            check(expected.at_rail == ((frame.saturated >> k & 1) != 0));
        }
    }
    check(counts[TACTILED_LINK_LOST] == reported);
    check(counts[TACTILED_LINK_BAD_VALUE] + counts[TACTILED_LINK_REPEATED] == refused);
    return 0;
}
