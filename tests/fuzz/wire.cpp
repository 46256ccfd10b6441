// Both decoders. The first byte chooses the format and the size of the chunks.
// Oracles: the same frames whatever the chunks; a frame's channels are finite or marked missing; every frame of the binary
// format survives being encoded and decoded again; bytes in = bytes counted.
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"

namespace {

using namespace tactiled;

void check(bool holds) {
    if (!holds) std::abort();
}

std::vector<Frame> decode(bool cobs, std::span<const std::uint8_t> bytes, std::size_t chunk) {
    LinkCounts counts;
    std::unique_ptr<StreamDecoder> decoder;
    if (cobs)
        decoder = std::make_unique<CobsDecoder>(counts);
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

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 1) return 0;
    const bool cobs = (data[0] & 1) != 0;
    const std::span<const std::uint8_t> bytes(data + 1, size - 1);
    const auto whole = decode(cobs, bytes, StreamDecoder::kMostBytes);
    const auto cut = decode(cobs, bytes, 1 + data[0] / 2);
    check(whole.size() == cut.size());
    for (std::size_t i = 0; i < whole.size(); ++i) {
        check(same(whole[i], cut[i]));
        const Frame& f = whole[i];
        check(f.n_channels >= 1 && f.n_channels <= kMaxChannels);
        for (unsigned k = 0; k < f.n_channels; ++k) check(std::isfinite(f.channel[k]) != ((f.missing >> k & 1u) != 0));
        if (!cobs) continue;
        std::array<std::uint8_t, kCobsMostEncoded> again;
        const std::size_t n = encode_cobs(f, 32, again);
        const auto back = decode(true, {again.data(), n}, StreamDecoder::kMostBytes);
        check(back.size() == 1 && back[0].sequence == f.sequence && back[0].n_channels == f.n_channels);
        for (unsigned k = 0; k < f.n_channels; ++k) check((f.missing >> k & 1u) != 0 || back[0].channel[k] == f.channel[k]);
    }
    return 0;
}
