#include "drivers/wire/kms40_line.hpp"

#include <charconv>
#include <cmath>

namespace tactiled {
namespace {

constexpr std::uint8_t kStart[] = {'L', '1', '(', ')', '\n'}, kStop[] = {'L', '0', '(', ')', '\n'};
constexpr std::string_view kHead = "F={";

}  // namespace

std::span<const std::uint8_t> Kms40Decoder::start_bytes() const noexcept { return kStart; }
std::span<const std::uint8_t> Kms40Decoder::stop_bytes() const noexcept { return kStop; }

void Kms40Decoder::reset() noexcept {
    StreamDecoder::reset();
    length_ = 0;
}

bool Kms40Decoder::take(std::uint8_t byte, Frame& frame) noexcept {
    if (byte != '\n') {
        if (length_ < line_.size()) line_[length_] = char(byte);
        ++length_;
        return false;
    }
    const std::size_t length = length_;
    length_ = 0;
    if (length > line_.size()) {
        ++counts_[TACTILED_LINK_BAD_LENGTH];
    } else {
        std::string_view line(line_.data(), length);
        if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
        if (read_line(line, frame)) return true;
        if (line.starts_with(kHead)) ++counts_[TACTILED_LINK_BAD_VALUE];  // else the answer to a command
    }
    counts_[TACTILED_LINK_SKIPPED] += std::uint32_t(length + 1);
    return false;
}

bool Kms40Decoder::read_line(std::string_view line, Frame& frame) noexcept {
    if (!line.starts_with(kHead)) return false;
    const char* at = line.data() + kHead.size();
    const char* const end = line.data() + line.size();
    frame = Frame{};
    for (; frame.n_channels < 6; ++frame.n_channels) {
        double& number = frame.channel[frame.n_channels];
        const auto [after, error] = std::from_chars(at, end, number);
        if (error != std::errc{} || !std::isfinite(number)) return false;
        if (after == end || *after != (frame.n_channels < 5 ? ',' : '}')) return false;
        at = after + 1;
    }
    std::int64_t time = 0;
    if (at == end || *at != ',') return false;
    const auto [after, error] = std::from_chars(at + 1, end, time);
    return error == std::errc{} && after == end;
}

}  // namespace tactiled
