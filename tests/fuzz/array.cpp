// Pieces of arrays and answers, as datagrams and as a COBS stream. The first bytes choose the shape; each message is made of
// the input's decisions and gets a right CRC, which no fuzzer finds, or is bytes of the input.
// Oracles: each taxel of a frame has the numbers of a message with its device, number and time, read here by the page alone;
// the frames and counts are the same over a stream, whatever the chunks; what is refused changes nothing.
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "drivers/wire/array_frame.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using fuzz::check;
using Bytes = std::vector<std::uint8_t>;

void append(Bytes& bytes, std::uint64_t number, int size) {
    for (int i = 0; i < size; ++i) bytes.push_back(std::uint8_t(number >> (8 * i)));
}

std::uint64_t number_at(const Bytes& bytes, std::size_t at, int size) {
    std::uint64_t number = 0;
    for (int i = size; i-- > 0;) number = number << 8 | bytes[at + std::size_t(i)];
    return number;
}

void append_crc(Bytes& bytes) {
    std::uint32_t crc = 0xFFFFFFFF;
    for (const std::uint8_t byte : bytes) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
    }
    append(bytes, ~crc, 4);
}

constexpr int kSizes[] = {1, 1, 2, 2, 4, 4};

Bytes next_message(fuzz::Input& in, TaxelShape shape) {
    const std::uint8_t kind = in.byte();
    Bytes bytes;
    if (kind % 8 == 0) {
        const auto raw = in.take(kind / 8 * 4u);
        bytes.assign(raw.begin(), raw.end());
    } else if (kind % 8 == 1) {
        bytes = {4, in.byte(), 0, 0};
        append(bytes, in.number(2), 4);
        append(bytes, in.number(2), 4);
    } else {
        const std::uint8_t type = in.byte() % 6, flags = kind / 8 % 4, values = std::uint8_t(shape.values);
        bytes = {3, std::uint8_t(in.byte() % 17), type, flags};
        append(bytes, in.number(kind % 2 != 0 ? 1 : 4), 4);
        append(bytes, in.byte() % 4, 4);
        append(bytes, shape.taxels, 2);
        append(bytes, values, 2);
        const unsigned first = in.byte() % (shape.taxels + 1u), count = in.byte() % (shape.taxels + 2u - first);
        append(bytes, first, 2);
        append(bytes, count, 2);
        const std::size_t size = (flags & 1u) * ((count + 7) / 8) + std::size_t(count) * values * std::size_t(kSizes[type]);
        const auto numbers = in.take(size);
        bytes.insert(bytes.end(), numbers.begin(), numbers.end());
        bytes.resize(20 + size, 0x80);
        if (kind % 8 == 7) bytes.pop_back();
    }
    append_crc(bytes);
    return bytes;
}

// The number of a value of a message, by the page.
float value_in(const Bytes& message, std::size_t taxel, std::size_t v) {
    const std::size_t values = message[14], i = taxel - number_at(message, 16, 2), count = number_at(message, 18, 2);
    const std::size_t bitmap = (message[3] & 1u) != 0 ? (count + 7) / 8 : 0;
    if (bitmap != 0 && (message[20 + i / 8] >> i % 8 & 1) != 0) return std::numeric_limits<float>::quiet_NaN();
    const int size = kSizes[message[2]];
    const std::uint64_t raw = number_at(message, 20 + bitmap + (i * values + v) * std::size_t(size), size);
    if (message[2] == 5) {
        const auto bits = std::uint32_t(raw);
        float value = 0;
        std::memcpy(&value, &bits, 4);
        return value;
    }
    const bool is_signed = message[2] % 2 == 0;
    const std::int64_t range = std::int64_t{1} << (8 * size), top = (is_signed ? range / 2 : range) - 1;
    const std::int64_t number = std::int64_t(raw) > top ? std::int64_t(raw) - range : std::int64_t(raw);
    if (number == top) return std::numeric_limits<float>::infinity();
    if (is_signed && number == -top - 1) return -std::numeric_limits<float>::infinity();
    return float(number);
}

bool is_equal(float a, float b) { return std::memcmp(&a, &b, sizeof a) == 0 || (std::isnan(a) && std::isnan(b)); }

// A message of the frame has the values of this taxel.
bool is_sent(const Frame& frame, const std::vector<Bytes>& messages, const Taxels& taxels, std::size_t taxel) {
    for (const Bytes& message : messages) {
        if (message.size() < 25 || message[0] != 3 || message[1] != frame.device || message[2] > 5) continue;
        const std::size_t first = number_at(message, 16, 2), count = number_at(message, 18, 2);
        if (number_at(message, 4, 4) != frame.sequence || taxel < first || taxel >= first + count) continue;
        const bool has_time = (message[3] & 2u) != 0;
        if (has_time ? number_at(message, 8, 4) != std::uint32_t(frame.device_time_us) : frame.device_time_us != 0) continue;
        const std::size_t bitmap = (message[3] & 1u) * ((count + 7) / 8);
        if (message.size() != 24 + bitmap + count * taxels.shape.values * std::size_t(kSizes[message[2]])) continue;
        bool is_same = true;
        for (std::size_t v = 0; v < taxels.shape.values; ++v)
            is_same &= is_equal(taxels.value[v * taxels.shape.taxels + taxel], value_in(message, taxel, v));
        if (is_same) return true;
    }
    return false;
}

struct Received {
    std::vector<Frame> frames;
    std::vector<float> values;
    LinkCounts counts;
};

Received as_datagrams(const std::vector<Bytes>& messages, TaxelShape shape) {
    Received all;
    ArrayAssembler assembler(shape, all.counts);
    Frame frame;
    std::vector<Bytes> before;
    for (const Bytes& message : messages) {
        before.push_back(message);
        const auto taken = assembler.take(message, {1, 1, 1}, frame);
        if (taken == ArrayAssembler::Taken::refused) ++all.counts[assembler.fault()];
        if (taken != ArrayAssembler::Taken::frame) continue;
        all.frames.push_back(frame);
        const Taxels taxels = assembler.taxels();
        check(frame.n_channels == 0 && (taxels.value.empty() || taxels.shape == shape));
        all.values.insert(all.values.end(), taxels.value.begin(), taxels.value.end());
        for (std::size_t i = 0; i < taxels.shape.taxels; ++i) check(is_sent(frame, before, taxels, i));
    }
    return all;
}

Received as_stream(const std::vector<Bytes>& messages, TaxelShape shape, std::size_t chunk) {
    Bytes bytes{0};
    for (const Bytes& message : messages) {
        Bytes coded(message.size() + message.size() / 254 + 2);
        coded.resize(put_cobs(message, coded.data()));
        for (std::size_t i = 0; i + 1 < coded.size(); ++i) check(coded[i] != 0);
        bytes.insert(bytes.end(), coded.begin(), coded.end());
    }
    Received all;
    CobsDecoder decoder(all.counts, shape);
    Frame frame;
    for (std::size_t at = 0; at < bytes.size(); at += chunk) {
        decoder.push({bytes.data() + at, std::min(chunk, bytes.size() - at)}, 1);
        while (decoder.next(frame)) {
            all.frames.push_back(frame);
            const Taxels taxels = decoder.taxels();
            all.values.insert(all.values.end(), taxels.value.begin(), taxels.value.end());
        }
    }
    check(all.counts[TACTILED_LINK_BYTES] == bytes.size() && all.counts[TACTILED_LINK_FRAMES] == all.frames.size());
    return all;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    fuzz::Input in(data, size);
    const TaxelShape shape{std::uint16_t(1 + in.byte() % 70), std::uint16_t(1 + in.byte() % 8)};
    const std::size_t chunk = 1u + in.byte() * 16u;
    std::vector<Bytes> messages;
    while (!in.is_empty()) {
        Bytes message = next_message(in, shape);
        const bool is_array = message[0] == 3 || message[0] == 4;  // the others are frames of channels on a stream
        if (is_array && message.size() <= max_array_bytes(shape)) messages.push_back(std::move(message));
    }
    const Received whole = as_datagrams(messages, shape),
                   cut = as_stream(messages, shape, std::min<std::size_t>(chunk, 4096));
    check(whole.frames.size() == cut.frames.size() && whole.values.size() == cut.values.size());
    for (std::size_t i = 0; i < whole.values.size(); ++i) check(is_equal(whole.values[i], cut.values[i]));
    for (std::size_t i = 0; i < whole.frames.size(); ++i) {
        const Frame &a = whole.frames[i], &b = cut.frames[i];
        check(a.sequence == b.sequence && a.device == b.device && a.device_time_us == b.device_time_us && a.lost == b.lost);
    }
    for (const auto kind : {TACTILED_LINK_LOST, TACTILED_LINK_REPEATED, TACTILED_LINK_BAD_LENGTH, TACTILED_LINK_BAD_VALUE,
                            TACTILED_LINK_BAD_CHECKSUM})
        check(whole.counts[kind] == cut.counts[kind]);
    return 0;
}
