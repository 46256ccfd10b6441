#include "drivers/wire/cobs_frame.hpp"

#include <algorithm>
#include <boost/crc.hpp>
#include <cmath>
#include <limits>

#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

using Crc16 = boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false>;  // CRC-16/CCITT-FALSE

constexpr std::uint8_t kFormat24 = 1, kFormat32 = 2;
constexpr std::uint8_t kFlagMissing = 1, kFlagTime = 2;
constexpr std::size_t kHeader = 10;

std::uint32_t get(const std::uint8_t* bytes, int n) noexcept {
    std::uint32_t value = 0;
    for (int i = 0; i < n; ++i) value |= std::uint32_t(bytes[i]) << (8 * i);
    return value;
}

void put(std::uint8_t*& at, std::uint32_t value, int n) noexcept {
    for (int i = 0; i < n; ++i) *at++ = std::uint8_t(value >> (8 * i));
}

std::int32_t saturation_limit(int bits) noexcept { return std::int32_t((1u << (bits - 1)) - 1); }

constexpr std::size_t kMaxRun = 254;  // bytes after a code

std::size_t cobs_bytes(std::size_t plain) noexcept { return plain + plain / kMaxRun + 2; }

// Returns the length of the plain bytes, which is less than that of `encoded`, or 0 if `encoded` is not valid COBS.
std::size_t uncobs(std::span<const std::uint8_t> encoded, std::uint8_t* plain) noexcept {
    std::size_t n = 0;
    for (std::size_t i = 0; i < encoded.size();) {
        const std::size_t code = encoded[i++];
        if (code == 0 || i + code - 1 > encoded.size()) return 0;
        std::copy_n(encoded.begin() + std::ptrdiff_t(i), code - 1, plain + n);
        i += code - 1;
        n += code - 1;
        if (code <= kMaxRun && i < encoded.size()) plain[n++] = 0;
    }
    return n;
}

}  // namespace

CobsDecoder::CobsDecoder(LinkCounts& counts, TaxelShape shape)
    : DelimitedDecoder(counts, shape.taxels == 0 ? kCobsMaxEncoded - 1
                                                 : std::max(kCobsMaxEncoded, cobs_bytes(max_array_bytes(shape))) - 1),
      plain_(shape.taxels == 0 ? kCobsMaxEncoded : std::max(kCobsMaxEncoded, cobs_bytes(max_array_bytes(shape)))) {
    if (shape.taxels != 0) arrays_.emplace(shape, counts);
}

void CobsDecoder::reset() noexcept {
    DelimitedDecoder::reset();
    devices_.fill({});
    is_array_ = false;
    if (arrays_) arrays_->reset();
}

bool CobsDecoder::finish(std::span<const std::uint8_t> encoded, Frame& frame) noexcept {
    if (encoded.empty()) return false;  // zeros in a row are an idle line
    const std::span<std::uint8_t> plain = plain_;
    const std::size_t n = uncobs(encoded, plain.data());
    if (arrays_ && n != 0 && is_array_message(plain[0])) return take_array(plain.first(n), frame);
    if (n < kHeader + 3 + 2) return reject(TACTILED_LINK_BAD_LENGTH);
    Crc16 crc;
    crc.process_bytes(plain.data(), n - 2);
    if (crc.checksum() != get(&plain[n - 2], 2)) return reject(TACTILED_LINK_BAD_CHECKSUM);
    if (!read_plain({plain.data(), n - 2}, crc.checksum(), frame)) return false;
    is_array_ = false;
    return true;
}

bool CobsDecoder::take_array(std::span<const std::uint8_t> message, Frame& frame) noexcept {
    const auto taken =
        arrays_->take(message, {.since_ns = began().since_ns, .first_ns = began().t_ns, .t_ns = arrival().t_ns}, frame);
    if (taken == ArrayAssembler::Taken::refused) return reject(arrays_->fault());
    if (const Echo echo = arrays_->take_echo(); echo.number != 0) echo_ = echo;
    if (taken != ArrayAssembler::Taken::frame) return false;
    is_array_ = true;
    return true;
}

bool CobsDecoder::read_plain(std::span<const std::uint8_t> plain, std::uint32_t crc, Frame& frame) noexcept {
    const std::uint8_t format = plain[0], device = plain[1], channels = plain[2], flags = plain[3];
    const int bytes = format == kFormat24 ? 3 : 4;
    const std::size_t mask_bytes = (flags & kFlagMissing) != 0 ? 4 : 0;
    if ((format != kFormat24 && format != kFormat32) || device >= kCobsMaxDevices || channels == 0 ||
        channels > kMaxChannels || (flags & ~(kFlagMissing | kFlagTime)) != 0 ||
        plain.size() != kHeader + mask_bytes + std::size_t(channels) * std::size_t(bytes))
        return reject(TACTILED_LINK_BAD_LENGTH);

    Device& known = devices_[device];
    const std::uint32_t sequence = get(&plain[4], 2), time_us = get(&plain[6], 4);
    const bool has_time = (flags & kFlagTime) != 0;
    const auto elapsed_us = std::int32_t(time_us - std::uint32_t(known.time_us));
    const bool clock_went_back = has_time && known.seen && elapsed_us < 0;
    const auto verdict = known.sequence.next(sequence, 16, crc, clock_went_back);
    if (!verdict.accept) {
        ++counts_[TACTILED_LINK_REPEATED];
        return false;
    }
    counts_[TACTILED_LINK_LOST] += verdict.lost;
    if (has_time) known.time_us = known.seen && !clock_went_back ? known.time_us + std::uint32_t(elapsed_us) : time_us;
    known.seen = has_time;

    frame = Frame{};
    frame.device_time_us = has_time ? known.time_us : 0;
    frame.device = device;
    frame.n_channels = channels;
    frame.lost = verdict.lost;
    put_number(frame, sequence, 16, verdict);
    if (mask_bytes != 0) frame.missing = get(&plain[kHeader], 4);
    const std::int32_t top = bytes == 3 ? saturation_limit(24) : std::numeric_limits<std::int32_t>::max();
    for (unsigned k = 0; k < channels; ++k) {
        const std::uint32_t raw = get(&plain[kHeader + mask_bytes + std::size_t(k) * std::size_t(bytes)], bytes);
        const auto value = bytes == 3 ? std::int32_t(raw << 8) >> 8 : std::int32_t(raw);
        const bool missing = (frame.missing >> k & 1u) != 0;
        frame.channel[k] = missing ? std::numeric_limits<double>::quiet_NaN() : double(value);
        if (!missing && (value >= top || value <= -top - 1)) frame.saturated |= 1u << k;
    }
    return true;
}

std::size_t encode_cobs(const Frame& frame, int bits, std::span<std::uint8_t, kCobsMaxEncoded> out) noexcept {
    std::array<std::uint8_t, kCobsMaxPlain> plain;
    std::uint8_t* at = plain.data();
    const bool has_time = frame.device_time_us != 0;
    put(at, bits == 24 ? kFormat24 : kFormat32, 1);
    put(at, frame.device, 1);
    put(at, frame.n_channels, 1);
    put(at, std::uint32_t((frame.missing != 0 ? kFlagMissing : 0) | (has_time ? kFlagTime : 0)), 1);
    put(at, frame.sequence, 2);
    put(at, std::uint32_t(frame.device_time_us), 4);
    if (frame.missing != 0) put(at, frame.missing, 4);
    const double top = bits == 24 ? double(saturation_limit(24)) : double(std::numeric_limits<std::int32_t>::max());
    for (unsigned k = 0; k < frame.n_channels; ++k) {
        const bool missing = (frame.missing >> k & 1u) != 0;
        const double value = missing ? 0 : std::clamp(std::nearbyint(frame.channel[k]), -top - 1, top);
        put(at, std::uint32_t(std::int32_t(value)), bits / 8);
    }
    Crc16 crc;
    crc.process_bytes(plain.data(), std::size_t(at - plain.data()));
    put(at, crc.checksum(), 2);

    return put_cobs({plain.data(), std::size_t(at - plain.data())}, out.data());
}

std::size_t put_cobs(std::span<const std::uint8_t> plain, std::uint8_t* out) noexcept {
    std::size_t code_at = 0, n = 1;
    for (std::size_t i = 0; i < plain.size(); ++i) {
        if (plain[i] != 0) out[n++] = plain[i];
        const bool is_full = n - code_at > kMaxRun;
        if ((plain[i] != 0 && !is_full) || (is_full && i + 1 == plain.size())) continue;
        out[code_at] = std::uint8_t(n - code_at);
        code_at = n++;
    }
    out[code_at] = std::uint8_t(n - code_at);
    out[n++] = 0;
    return n;
}

namespace {

std::vector<std::uint8_t> encode(const Frame& frame, const StreamSettings& settings) {
    std::array<std::uint8_t, kCobsMaxEncoded> bytes;
    const std::size_t n = encode_cobs(frame, settings.bits, bytes);
    return {bytes.begin(), bytes.begin() + std::ptrdiff_t(n)};
}

std::unique_ptr<StreamDecoder> make(Options& options, LinkCounts& counts) {
    return std::make_unique<CobsDecoder>(counts, read_taxel_shape(options, false));
}

std::optional<StreamGuess> recognise(std::span<const std::uint8_t> bytes, double) {
    LinkCounts counts;
    CobsDecoder decoder(counts);
    StreamGuess guess;
    Frame frame;
    for (std::size_t at = 0; at < bytes.size(); at += StreamDecoder::kMaxBytes) {
        decoder.push(bytes.subspan(at, std::min(StreamDecoder::kMaxBytes, bytes.size() - at)), 1);
        while (decoder.next(frame)) ++guess.good;
    }
    guess.bad = counts[TACTILED_LINK_BAD_CHECKSUM] + counts[TACTILED_LINK_BAD_LENGTH] + counts[TACTILED_LINK_BAD_VALUE];
    // a CRC of 16 bits matches by chance, but not three times
    if (guess.good < 3 || guess.good <= guess.bad) return std::nullopt;
    guess.keys = "format = \"cobs\"\n";
    if (frame.device_time_us == 0) guess.notes.emplace_back("its frames have no time: a delay is not detected");
    return guess;
}

const StreamFormat entry{
    .name = "cobs", .max_devices = kCobsMaxDevices, .make = make, .encode = encode, .recognise = recognise};

}  // namespace
}  // namespace tactiled
