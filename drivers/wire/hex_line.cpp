#include "drivers/wire/hex_line.hpp"

#include <charconv>

#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kDigitBits = 4;

// Reads all of the text as an unsigned number.
bool read_digits(std::string_view text, int base, std::uint32_t& value) noexcept {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
    return error == std::errc{} && end == text.data() + text.size();
}

}  // namespace

void HexDecoder::reset() noexcept {
    LineDecoder::reset();
    counted_ = false;
}

bool HexDecoder::read_line(std::string_view line, Frame& frame) noexcept {
    const std::size_t whole =
        (format_.first == HexFormat::Digit::none ? 0 : 1) + std::size_t{format_.channels} * format_.digits;
    if (line.size() != whole) return reject(TACTILED_LINK_BAD_LENGTH);
    frame = Frame{};
    std::uint32_t digit = 0;
    if (format_.first != HexFormat::Digit::none) {
        if (!read_digits(line.substr(0, 1), 10, digit)) return reject(TACTILED_LINK_BAD_VALUE);
        line.remove_prefix(1);
    }
    for (; frame.n_channels < format_.channels; ++frame.n_channels, line.remove_prefix(format_.digits)) {
        std::uint32_t number = 0;
        if (!read_digits(line.substr(0, format_.digits), 16, number) || number > format_.max)
            return reject(TACTILED_LINK_BAD_VALUE);
        if (number == 0 || number == format_.max) frame.saturated |= 1u << frame.n_channels;
        frame.channel[frame.n_channels] = number;
    }
    return format_.first != HexFormat::Digit::counter || count_on(digit, frame);
}

// A loss of ten frames in a row cannot be detected from one digit. Two numbers differ by less than 2^kDigitBits.
bool HexDecoder::count_on(unsigned digit, Frame& frame) noexcept {
    const std::uint32_t step = counted_ ? (digit + 10 - digit_) % 10 : 1;
    if (step == 0) {
        ++counts_[TACTILED_LINK_REPEATED];
        return skip();
    }
    counter_ = counted_ ? counter_ + step : digit;
    digit_ = digit;
    counted_ = true;
    frame.sequence = counter_;
    frame.has_sequence = true;
    frame.sequence_bits = kDigitBits;
    frame.lost = step - 1;
    counts_[TACTILED_LINK_LOST] += frame.lost;
    return true;
}

namespace {

std::unique_ptr<StreamDecoder> make(Options& options, LinkCounts& counts) {
    HexFormat format;
    format.channels = unsigned(options.integer("channels", {1, double(kMaxChannels)}));
    format.digits = unsigned(options.integer("digits", {1, 8}, 4));
    const auto highest = std::int64_t((std::uint64_t{1} << 4 * format.digits) - 1);
    format.max = std::uint32_t(options.integer("most", {1, double(highest)}, highest));
    const std::string digit = options.one_of("digit", {"none", "ignored", "counter"}, "none");
    if (digit != "none") format.first = digit == "counter" ? HexFormat::Digit::counter : HexFormat::Digit::ignored;
    format.start = options.text("start", "");
    format.stop = options.text("stop", "");
    return std::make_unique<HexDecoder>(format, counts);
}

const StreamFormat entry{.name = "hex", .make = make};

}  // namespace
}  // namespace tactiled
