#include "drivers/wire/register_set.hpp"

#include <bit>
#include <cmath>
#include <limits>

namespace tactiled {
namespace {

std::uint32_t bits_of(const RegisterValue& value, std::span<const std::uint16_t> words, std::uint16_t first) noexcept {
    const std::size_t at = std::size_t(value.at - first);
    if (words_of(value.type) == 1) return words[at];
    const std::uint32_t high = words[at + (value.low_word_first ? 1 : 0)];
    return high << 16 | words[at + (value.low_word_first ? 0 : 1)];
}

}  // namespace

bool register_is_saturated(const RegisterValue& value, std::span<const std::uint16_t> words, std::uint16_t first) noexcept {
    const std::uint32_t bits = bits_of(value, words, first);
    switch (value.type) {
        case RegisterType::int16: return bits == 0x7FFF || bits == 0x8000;
        case RegisterType::uint16: return bits == 0xFFFF;
        case RegisterType::int32: return bits == 0x7FFF'FFFF || bits == 0x8000'0000;
        case RegisterType::uint32: return bits == 0xFFFF'FFFF;
        case RegisterType::float32: break;
    }
    return false;
}

double register_value(const RegisterValue& value, std::span<const std::uint16_t> words, std::uint16_t first) noexcept {
    const std::uint32_t bits = bits_of(value, words, first);
    double number = 0;
    switch (value.type) {
        case RegisterType::int16: number = double(std::int16_t(bits)); break;
        case RegisterType::int32: number = double(std::int32_t(bits)); break;
        case RegisterType::uint16:
        case RegisterType::uint32: number = double(bits); break;
        case RegisterType::float32: number = double(std::bit_cast<float>(bits)); break;
    }
    return number * value.scale;
}

bool read_registers(const RegisterSet& set, std::span<const std::uint16_t> words, SequenceTracker& sequence,
                    LinkCounts& counts, Frame& frame) noexcept {
    const auto refuse = [&](tactiled_link_count kind) {
        ++counts[kind];
        return false;
    };
    for (const auto& ready : set.ready)
        if ((words[std::size_t(ready.at - set.at)] & ready.mask) != ready.value) return refuse(TACTILED_LINK_BAD_VALUE);
    frame = Frame{};
    for (const auto& channel : set.channel) {
        double& number = frame.channel[frame.n_channels];
        number = register_value(channel, words, set.at);
        if (std::isinf(number)) return refuse(TACTILED_LINK_BAD_VALUE);
        if (std::isnan(number)) frame.missing |= 1u << frame.n_channels;
        if (register_is_saturated(channel, words, set.at)) frame.saturated |= 1u << frame.n_channels;
        ++frame.n_channels;
    }
    for (const auto& counter : set.sequence) {  // last: a frame that is dropped must not count as seen
        const std::uint32_t count = bits_of(counter, words, set.at);
        // Registers may change while their counter does not; that does not indicate a second device.
        const auto verdict = sequence.next(count, 16 * words_of(counter.type), 0, false);
        if (!verdict.accept) return refuse(TACTILED_LINK_REPEATED);
        counts[TACTILED_LINK_LOST] += verdict.lost;
        frame.lost = verdict.lost;
        put_number(frame, count, 16 * words_of(counter.type), verdict);
    }
    return true;
}

}  // namespace tactiled
