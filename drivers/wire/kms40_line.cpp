#include "drivers/wire/kms40_line.hpp"

#include <charconv>
#include <cmath>

#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kStart[] = {'L', '1', '(', ')', '\n'}, kStop[] = {'L', '0', '(', ')', '\n'};
constexpr std::string_view kHead = "F={";

// Reads "fx,fy,fz,mx,my,mz},time" and nothing after it.
bool read_forces(std::string_view text, Frame& frame) noexcept {
    const char* at = text.data();
    const char* const end = text.data() + text.size();
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

}  // namespace

std::span<const std::uint8_t> Kms40Decoder::start_bytes() const noexcept { return kStart; }
std::span<const std::uint8_t> Kms40Decoder::stop_bytes() const noexcept { return kStop; }

bool Kms40Decoder::read_line(std::string_view line, Frame& frame) noexcept {
    if (!line.starts_with(kHead)) return skip();  // the answer to a command
    if (read_forces(line.substr(kHead.size()), frame)) return true;
    ++counts_[TACTILED_LINK_BAD_VALUE];  // also for the first line: a line with this head is complete
    return skip();
}

namespace {

std::unique_ptr<StreamDecoder> make(Options&, LinkCounts& counts) { return std::make_unique<Kms40Decoder>(counts); }
const StreamFormat entry{.name = "kms40", .on_tty = false, .make = make};

}  // namespace
}  // namespace tactiled
