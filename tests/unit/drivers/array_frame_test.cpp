// Arrays: the properties on their page; any order, loss and repetition of pieces; and the age of a frame of several pieces.
#include "drivers/wire/array_frame.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "drivers/wire/cobs_frame.hpp"
#include "drivers/wire/stream_age.hpp"
#include "tests/unit/drivers/wire_bytes.hpp"

namespace tactiled::array_frame_test {
namespace {

using Taken = ArrayAssembler::Taken;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInfinite = std::numeric_limits<float>::infinity();

namespace firmware {
#include "array_firmware.inc"
}

// The numbers of a frame that can be told from all others: 1000 n + position.
std::vector<float> values_of(std::uint32_t n, TaxelShape shape) {
    std::vector<float> values(shape.size());
    std::iota(values.begin(), values.end(), float(1000 * n));
    return values;
}

Bytes piece_of(std::uint32_t n, TaxelShape shape, unsigned first, unsigned count,
               std::optional<std::uint32_t> time_us = {}) {
    return encode_array_piece(
        {.sequence = n, .time_us = time_us, .shape = shape, .first = std::uint16_t(first), .count = std::uint16_t(count)},
        values_of(n, shape));
}

// An assembler whose messages arrive in one millisecond each.
struct Receiver {
    explicit Receiver(TaxelShape shape) : assembler(shape, counts) {}
    Taken take(const Bytes& message) {
        t_ns += 1'000'000;
        const Taken taken = assembler.take(message, {t_ns, t_ns, t_ns}, frame);
        if (taken == Taken::frame) {
            frame.t_ns = t_ns;
            frames.push_back(frame);
        }
        if (taken == Taken::refused) ++faults[assembler.fault()];
        return taken;
    }
    std::vector<float> values() const { return {assembler.taxels().value.begin(), assembler.taxels().value.end()}; }

    LinkCounts counts, faults;
    ArrayAssembler assembler;
    Frame frame;
    std::vector<Frame> frames;
    std::uint64_t t_ns = 1'000'000'000;
};

TEST(ArrayFrame, TheExamplesOfItsPageAreRight) {
    Receiver receiver({3, 2});
    const std::vector<float> all{7, 1, 256, 8, -2, kInfinite};
    EXPECT_EQ(receiver.take(hex(line_after("array_frame.md", "numbers 1, −2"))), Taken::used);
    const Bytes rest = encode_array_piece(
        {.type = ArrayType::u8, .sequence = 5, .time_us = 1000, .shape = {3, 2}, .first = 0, .count = 1}, all);
    ASSERT_EQ(receiver.take(rest), Taken::frame);
    EXPECT_EQ(receiver.values(), all);
    EXPECT_EQ(receiver.frame.sequence, 5u);
    EXPECT_EQ(receiver.frame.device_time_us, 1000u);
    EXPECT_EQ(receiver.take(hex(line_after("array_frame.md", "The answer of device 0"))), Taken::used);
    const auto echo = receiver.assembler.take_echo();
    EXPECT_EQ(echo.number, 7u);
    EXPECT_EQ(echo.time_us, 1234u);
    EXPECT_EQ(receiver.assembler.take_echo().number, 0u) << "once";
}

TEST(ArrayFrame, TheFirmwareOfItsPageIsUnderstood) {
    constexpr TaxelShape kShape{50, 3};
    std::vector<std::int16_t> value(kShape.size());
    std::iota(value.begin(), value.end(), std::int16_t(-70));
    Receiver receiver(kShape);
    for (std::uint16_t first = 0; first < 50; first = std::uint16_t(first + 20)) {
        Bytes out(24 + 2 * 20 * 3);
        const auto count = std::uint16_t(std::min(20, 50 - first));
        out.resize(firmware::tactile_piece(out.data(), value.data(), 50, 3, first, count, 9, 123));
        EXPECT_EQ(receiver.take(out), first == 40 ? Taken::frame : Taken::used);
    }
    EXPECT_EQ(receiver.frame.device_time_us, 123u);
    for (std::size_t i = 0; i < 50; ++i)
        for (std::size_t v = 0; v < 3; ++v) EXPECT_EQ(receiver.values()[v * 50 + i], float(value[i * 3 + v]));
    Bytes answer(16);
    ASSERT_EQ(firmware::tactile_answer(answer.data(), 5, 99), answer.size());
    EXPECT_EQ(answer, encode_array_echo(0, 5, 99));
}

TEST(ArrayFrame, TheLimitsOfATypeAreSaturatedExceptAnUnsignedZero) {
    struct Limits {
        ArrayType type;
        float low, high, inside;
    };
    for (const auto& [type, low, high, inside] : {Limits{ArrayType::i8, -128, 127, -127},
                                                  {ArrayType::u8, -1, 255, 0},
                                                  {ArrayType::i16, -32768, 32767, 32766},
                                                  {ArrayType::u16, -1, 65535, 0},
                                                  {ArrayType::i32, -2147483648.0f, 2147483648.0f, -8388607}}) {
        Receiver receiver({4, 1});
        const std::vector<float> sent{low, high, inside, kNaN};
        ASSERT_EQ(receiver.take(encode_array_piece({.type = type, .shape = {4, 1}, .count = 4}, sent)), Taken::frame);
        const auto values = receiver.values();
        EXPECT_EQ(values[0], low == -1 ? 0 : -kInfinite) << int(type);
        EXPECT_EQ(values[1], kInfinite) << int(type);
        EXPECT_EQ(values[2], inside) << int(type);
        EXPECT_TRUE(std::isnan(values[3])) << int(type);
    }
    Receiver receiver({4, 1});
    const std::vector<float> sent{-kInfinite, kInfinite, 1e-30f, kNaN};
    ASSERT_EQ(receiver.take(encode_array_piece({.shape = {4, 1}, .count = 4}, sent)), Taken::frame);
    EXPECT_EQ(std::memcmp(receiver.values().data(), sent.data(), 16), 0);
}

TEST(ArrayFrame, AnotherShapeLengthFlagOrChecksumIsRefused) {
    const Bytes good = piece_of(1, {6, 2}, 1, 3);
    for (std::size_t i = 0; i < good.size(); ++i)
        for (int bit = 0; bit < 8; ++bit) {
            Receiver receiver({6, 2});
            Bytes bad = good;
            bad[i] = std::uint8_t(bad[i] ^ 1u << bit);
            EXPECT_EQ(receiver.take(bad), Taken::refused);
            EXPECT_EQ(receiver.faults[TACTILED_LINK_BAD_CHECKSUM], 1u);
        }
    for (const TaxelShape other : {TaxelShape{5, 2}, {7, 2}, {6, 1}, {6, 3}}) {
        Receiver receiver({6, 2});
        EXPECT_EQ(receiver.take(piece_of(1, other, 0, 2)), Taken::refused);
        EXPECT_EQ(receiver.faults[TACTILED_LINK_BAD_LENGTH], 1u);
    }
    Receiver receiver({6, 2});
    EXPECT_EQ(receiver.take({}), Taken::refused);
    for (const auto& [at, byte] : {std::pair<std::size_t, int>{0, 5},
                                   {0, 0},
                                   {1, 16},
                                   {2, 6},
                                   {3, 4},
                                   {3, 1},
                                   {15, 1},
                                   {16, 4},
                                   {17, 1},
                                   {18, 0},
                                   {18, 4},
                                   {18, 2}}) {
        Bytes bad(good.begin(), good.end() - 4);
        bad[at] = std::uint8_t(byte);
        // a right CRC, by its definition
        std::uint32_t crc = 0xFFFFFFFF;
        for (const std::uint8_t b : bad) {
            crc ^= b;
            for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
        }
        for (int k = 0; k < 4; ++k) bad.push_back(std::uint8_t(~crc >> 8 * k));
        EXPECT_EQ(receiver.take(bad), Taken::refused) << at << " " << byte;
    }
    EXPECT_EQ(receiver.faults[TACTILED_LINK_BAD_LENGTH], 13u);
    EXPECT_EQ(receiver.counts[TACTILED_LINK_REPEATED], 0u);
}

// The pieces of one frame: a cut of its taxels into ranges.
std::vector<std::pair<unsigned, unsigned>> cut(unsigned taxels) {
    std::vector<std::pair<unsigned, unsigned>> pieces;
    for (unsigned first = 0; first < taxels;) {
        const unsigned count = *rc::gen::inRange(1u, taxels - first + 1);
        pieces.emplace_back(first, count);
        first += count;
    }
    return pieces;
}

RC_GTEST_PROP(ArrayFrame, AFrameIsCompleteInAnyOrderAndCutWithRepeatedPieces, ()) {
    const TaxelShape shape{std::uint16_t(*rc::gen::inRange(1, 60)), std::uint16_t(*rc::gen::inRange(1, 9))};
    Receiver receiver(shape);
    std::uint32_t repeated = 0;
    for (std::uint32_t n = *rc::gen::inRange(0u, 3u) - 2, end = n + 4; n != end; ++n) {
        const auto pieces = cut(shape.taxels);
        std::vector<std::size_t> order;
        for (std::size_t i = 0; i < pieces.size(); ++i) order.insert(order.end(), *rc::gen::inRange(1u, 3u), i);
        for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[*rc::gen::inRange<std::size_t>(0, i)]);
        const std::size_t before = receiver.frames.size();
        for (const std::size_t i : order) (void)receiver.take(piece_of(n, shape, pieces[i].first, pieces[i].second, n));
        repeated += std::uint32_t(order.size() - pieces.size());
        RC_ASSERT(receiver.frames.size() == before + 1);
        RC_ASSERT(receiver.values() == values_of(n, shape));
        RC_ASSERT(receiver.frame.sequence == n);
    }
    RC_ASSERT(receiver.counts[TACTILED_LINK_LOST] == 0u);
    RC_ASSERT(receiver.counts[TACTILED_LINK_REPEATED] == repeated);
}

// A network that loses, repeats and delays pieces: each frame is one that was sent, and each missing one is counted.
RC_GTEST_PROP(ArrayFrame, NoFrameIsMixedAndEachMissingOneIsCounted, ()) {
    constexpr TaxelShape kShape{7, 2};
    std::vector<std::pair<double, Bytes>> on_the_way;
    for (std::uint32_t n = 100; n < 160; ++n)
        for (const auto& [first, count] : {std::pair{0u, 3u}, {3u, 2u}, {5u, 2u}})
            for (int copies = *rc::gen::element(0, 1, 1, 1, 1, 1, 1, 1, 1, 2); copies > 0; --copies) {
                const int late = *rc::gen::element(0, 0, 0, 0, 0, 0, 0, 1, 4, 20);
                on_the_way.emplace_back(3 * n + first / 3 + late, piece_of(n, kShape, first, count));
            }
    std::stable_sort(on_the_way.begin(), on_the_way.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    Receiver receiver(kShape);
    std::uint32_t lost = 0;
    for (const auto& each : on_the_way)
        if (receiver.take(each.second) == Taken::frame) {
            RC_ASSERT(receiver.values() == values_of(receiver.frame.sequence, kShape));
            lost += receiver.frame.lost;
        }
    for (std::size_t i = 1; i < receiver.frames.size(); ++i)
        RC_ASSERT(receiver.frames[i].sequence > receiver.frames[i - 1].sequence);
    if (receiver.frames.size() > 1)
        RC_ASSERT(receiver.frames.back().sequence - receiver.frames[0].sequence + 1 == receiver.frames.size() + lost);
    RC_ASSERT(receiver.counts[TACTILED_LINK_LOST] == lost);
}

TEST(ArrayFrame, ADeviceThatRestartsIsBelievedAtOnceByItsClockElseWithItsSecondFrame) {
    for (const bool has_clock : {true, false}) {
        Receiver receiver({4, 1});
        const auto send = [&](std::uint32_t n, std::uint32_t time_us) {
            for (const unsigned first : {0u, 2u})
                (void)receiver.take(piece_of(n, {4, 1}, first, 2, has_clock ? std::optional(time_us) : std::nullopt));
        };
        for (std::uint32_t n = 1000; n < 1005; ++n) send(n, n * 1000);
        (void)receiver.take(piece_of(1005, {4, 1}, 0, 2));  // it lost its supply within a frame
        for (std::uint32_t n = 0; n < 3; ++n) send(n, n * 1000);
        EXPECT_EQ(receiver.frames.size(), has_clock ? 8u : 7u);
        EXPECT_EQ(receiver.frame.sequence, 2u);
        EXPECT_EQ(receiver.values(), values_of(2, {4, 1}));
        EXPECT_EQ(receiver.counts[TACTILED_LINK_LOST], 1u);
    }
}

TEST(ArrayFrame, APieceWithAnotherTimeIsNotOfTheFrame) {
    Receiver receiver({4, 1});
    EXPECT_EQ(receiver.take(piece_of(3, {4, 1}, 0, 2, 5000)), Taken::used);
    EXPECT_EQ(receiver.take(piece_of(3, {4, 1}, 2, 2, 20)), Taken::refused);
    EXPECT_EQ(receiver.faults[TACTILED_LINK_BAD_VALUE], 1u);
    EXPECT_EQ(receiver.take(piece_of(3, {4, 1}, 2, 2)), Taken::refused);
    EXPECT_EQ(receiver.take(piece_of(3, {4, 1}, 2, 2, 5000)), Taken::frame);
}

TEST(ArrayFrame, TwoDevicesUnderOneNumberYieldNoTaxels) {
    Receiver receiver({2, 1});
    for (std::uint32_t n = 0; n < 20; ++n) {
        (void)receiver.take(piece_of(n, {2, 1}, 0, 2));
        (void)receiver.take(piece_of(5000 + n, {2, 1}, 0, 2));
    }
    (void)receiver.take(piece_of(20, {2, 1}, 0, 2));
    EXPECT_EQ(receiver.frame.n_channels, 0);
    EXPECT_TRUE(receiver.assembler.taxels().value.empty());
}

TEST(ArrayFrame, EachDeviceHasItsOwnFrame) {
    Receiver receiver({2, 1});
    const std::vector<float> left{1, 2}, right{3, 4};
    ArrayPiece piece{.device = 0, .sequence = 7, .shape = {2, 1}, .first = 0, .count = 1};
    const auto send = [&](std::uint8_t device, std::uint16_t first, const std::vector<float>& values) {
        piece.device = device;
        piece.first = first;
        return receiver.take(encode_array_piece(piece, values));
    };
    EXPECT_EQ(send(0, 0, left), Taken::used);
    EXPECT_EQ(send(15, 0, right), Taken::used);
    EXPECT_EQ(send(0, 1, left), Taken::frame);
    EXPECT_EQ(receiver.values(), left);
    EXPECT_EQ(send(15, 1, right), Taken::frame);
    EXPECT_EQ(receiver.frame.device, 15);
    EXPECT_EQ(receiver.values(), right);
}

// A measurement is not younger than its first piece, whatever proves the age of the last one.
TEST(ArrayFrame, TheAgeContainsTheTimeSinceTheFirstPiece) {
    constexpr std::uint64_t kStaleNs = 200'000'000, kApartNs = 600'000'000;
    for (const auto path : {Route::Path::direct, Route::Path::network})
        for (const bool echo : {false, true}) {
            StreamAge age(kStaleNs);
            age.open({.path = path, .device_clock = true, .has_echo = echo});
            Receiver receiver({2, 1});
            const auto judge = [&] {
                receiver.frame.taken_ns = receiver.frame.t_ns;
                age.judge(receiver.frame, receiver.frame.t_ns, echo ? receiver.frame.t_ns - 1'000'000 : 0);
            };
            for (std::uint32_t n = 0; n < 1000; ++n) {  // 2 ms a frame
                (void)receiver.take(piece_of(n, {2, 1}, 0, 1));
                ASSERT_EQ(receiver.take(piece_of(n, {2, 1}, 1, 1)), Taken::frame);
                judge();
            }
            EXPECT_LT(receiver.frame.bound_ns, 50e6);
            (void)receiver.take(piece_of(1000, {2, 1}, 0, 1));
            receiver.t_ns += kApartNs;
            ASSERT_EQ(receiver.take(piece_of(1000, {2, 1}, 1, 1)), Taken::frame);
            const std::uint64_t read_ns = receiver.frame.t_ns;
            judge();
            EXPECT_GE(receiver.frame.bound_ns, double(kApartNs)) << int(path) << echo;
            EXPECT_TRUE(receiver.frame.age == Frame::Age::unproved || receiver.frame.t_ns + kStaleNs < read_ns);
        }
}

TEST(ArrayFrame, AnAnswerWithinAFrameProvesTheNextOneOfItsDevice) {
    Receiver receiver({2, 1});
    EXPECT_EQ(receiver.take(piece_of(1, {2, 1}, 0, 1)), Taken::used);
    EXPECT_EQ(receiver.take(encode_array_echo(0, 5, 99)), Taken::used);
    EXPECT_EQ(receiver.assembler.take_echo().number, 0u) << "the open frame was measured before";
    EXPECT_EQ(receiver.take(piece_of(1, {2, 1}, 1, 1)), Taken::frame);
    EXPECT_EQ(receiver.assembler.take_echo().number, 0u);
    EXPECT_EQ(receiver.take(piece_of(2, {2, 1}, 0, 1)), Taken::used);
    EXPECT_EQ(receiver.assembler.take_echo().number, 5u);
}

// ---- over a stream ----

Bytes cobs(const Bytes& plain) {
    Bytes out(plain.size() + plain.size() / 254 + 2);
    out.resize(put_cobs(plain, out.data()));
    return out;
}

RC_GTEST_PROP(ArrayStream, PiecesOfAnyLengthSurviveCobsAndAnyCutIntoChunks, ()) {
    const TaxelShape shape{std::uint16_t(*rc::gen::element(1, 57, 58, 119, 120, 700, 4096)), 1};
    Bytes bytes{0};
    std::vector<std::vector<float>> sent;
    for (std::uint32_t n = 0; n < 3; ++n) {
        std::vector<float> values(shape.size());
        for (float& value : values) value = float(*rc::gen::element(0, 1, 257, 65793));  // bytes with and without zeros
        const ArrayPiece piece{.type = ArrayType::i32, .sequence = n, .shape = shape, .count = shape.taxels};
        const Bytes one = cobs(encode_array_piece(piece, values));
        RC_ASSERT(std::count(one.begin(), one.end(), 0) == 1 && one.back() == 0);
        bytes.insert(bytes.end(), one.begin(), one.end());
        sent.push_back(values);
    }
    LinkCounts counts;
    CobsDecoder decoder(counts, shape);
    Frame frame;
    std::size_t n = 0;
    for (std::size_t at = 0; at < bytes.size();) {
        const std::size_t chunk = std::min(*rc::gen::inRange<std::size_t>(1, 4097), bytes.size() - at);
        decoder.push({bytes.data() + at, chunk}, at + chunk);
        at += chunk;
        while (decoder.next(frame)) {
            RC_ASSERT(n < 3u);
            RC_ASSERT(std::equal(sent[n].begin(), sent[n].end(), decoder.taxels().value.begin()));
            RC_ASSERT(frame.sequence == n++);
            RC_ASSERT(frame.n_channels == 0);
        }
    }
    RC_ASSERT(n == 3u);
    RC_ASSERT(counts[TACTILED_LINK_SKIPPED] == 0u);
}

TEST(ArrayStream, BytesWithoutAZeroAreCutIntoRunsOf254) {
    for (const std::size_t n : {0u, 1u, 253u, 254u, 255u, 508u, 509u}) {
        Bytes plain(n, 7);
        const Bytes coded = cobs(plain);
        EXPECT_EQ(coded.size(), n + std::max<std::size_t>(1, (n + 253) / 254) + 1) << n;
        plain.push_back(0);
        plain.push_back(1);
        const Bytes with_zero = cobs(plain);
        EXPECT_EQ(std::count(with_zero.begin(), with_zero.end(), 0), 1) << n;
    }
}

TEST(ArrayStream, ArraysAndFramesOfChannelsShareALinkWithTaxelsOnly) {
    std::array<std::uint8_t, kCobsMaxEncoded> out;
    const std::size_t size = encode_cobs(frame_of(3, {1, 2}), 24, out);
    Bytes bytes{0};
    bytes.insert(bytes.end(), out.begin(), out.begin() + std::ptrdiff_t(size));
    const Bytes array = cobs(piece_of(9, {2, 2}, 0, 2));
    bytes.insert(bytes.end(), array.begin(), array.end());
    bytes.insert(bytes.end(), out.begin(), out.begin() + std::ptrdiff_t(encode_cobs(frame_of(4, {5, 6}), 24, out)));
    LinkCounts counts;
    CobsDecoder decoder(counts, {2, 2});
    decoder.push(bytes, 5);
    Frame frame;
    for (const bool is_array : {false, true, false}) {
        ASSERT_TRUE(decoder.next(frame));
        EXPECT_EQ(frame.n_channels, is_array ? 0 : 2);
        EXPECT_EQ(decoder.taxels().value.size(), is_array ? 4u : 0u);
    }
    EXPECT_TRUE(decoder.has_echo());
    LinkCounts without;
    CobsDecoder small(without);
    EXPECT_EQ(decode(small, bytes).size(), 2u);
    EXPECT_EQ(without[TACTILED_LINK_BAD_CHECKSUM], 1u);
    EXPECT_FALSE(small.has_echo());
}

// The backlog of a process that was stopped comes in several reads, which have the same earliest time.
TEST(ArrayStream, AFrameOfABacklogIsAsOldAsTheBacklog) {
    LinkCounts counts;
    CobsDecoder decoder(counts, {100, 1});
    Frame frame;
    Bytes bytes;
    for (std::uint32_t k = 0; k < 4; ++k) {
        const Bytes one = cobs(piece_of(k, {100, 1}, 0, 100));
        bytes.insert(bytes.end(), one.begin(), one.end());
    }
    unsigned n = 0;
    for (std::size_t at = 0; at < bytes.size(); at += 150) {
        decoder.push({bytes.data() + at, std::min<std::size_t>(150, bytes.size() - at)}, 500'000'000 + at, 1'000'000);
        while (decoder.next(frame)) {
            if (frame.since_ns == 0) continue;  // in one read
            EXPECT_EQ(frame.since_ns, 1'000'000u) << n;
            ++n;
        }
    }
    EXPECT_GE(n, 3u);
}

TEST(ArrayStream, AFrameWhoseBytesComeInSeveralReadsIsAsOldAsTheFirst) {
    const Bytes array = cobs(piece_of(9, {100, 1}, 0, 100));
    LinkCounts counts;
    CobsDecoder decoder(counts, {100, 1});
    Frame frame;
    decoder.push(array, 1'000'000, 900'000);
    ASSERT_TRUE(decoder.next(frame));
    EXPECT_EQ(frame.since_ns, 0u) << "in one read";
    const Bytes next = cobs(piece_of(10, {100, 1}, 0, 100));
    decoder.push({next.data(), 50}, 2'000'000, 1'900'000);
    EXPECT_FALSE(decoder.next(frame));
    decoder.push({next.data() + 50, next.size() - 50}, 700'000'000, 699'000'000);
    ASSERT_TRUE(decoder.next(frame));
    EXPECT_EQ(frame.t_ns, 700'000'000u);
    EXPECT_EQ(frame.since_ns, 1'900'000u);
    EXPECT_EQ(frame.slice_ns, 698'000'000u);
}

TEST(ArrayStream, TheKeysOfTheShapeAreChecked) {
    for (const auto& [keys, fault] : {std::pair{"taxels = 0", "taxels = 0 is outside 1 .. 4096"},
                                      {"taxels = 4097", "taxels = 4097 is outside 1 .. 4096"},
                                      {"taxels = 4\nvalues = 9", "values = 9 is outside 1 .. 8"},
                                      {"values = 3", "values needs taxels"}}) {
        Problems problems;
        Options options = Options::parse_text(keys, "test.toml", problems);
        (void)read_taxel_shape(options, false);
        options.finish();
        ASSERT_EQ(problems.lines().size(), 1u) << keys;
        EXPECT_NE(problems.lines()[0].find(fault), std::string::npos) << problems.lines()[0];
    }
    Problems problems;
    Options options = Options::parse_text("taxels = 4", "test.toml", problems);
    EXPECT_EQ(read_taxel_shape(options, false), (TaxelShape{4, 1}));
}

}  // namespace
}  // namespace tactiled::array_frame_test
