// Both wire formats: what their pages promise, against bytes that were cut, changed, doubled and mixed with noise.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <random>
#include <string>

#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "drivers/wire/ft300_frame.hpp"
#include "drivers/wire/kms40_line.hpp"

namespace tactiled {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes bytes_of(std::string_view text) { return Bytes(text.begin(), text.end()); }

Bytes hex(const std::string& text) {
    Bytes bytes;
    for (std::size_t at = 0; at < text.size(); at += 3)
        bytes.push_back(std::uint8_t(std::stoi(text.substr(at, 2), nullptr, 16)));
    return bytes;
}

// The example that stands after the line that begins so, from the format's own page.
std::string line_after(const std::string& page, const std::string& beginning) {
    std::ifstream file(std::string(TACTILED_SOURCE_DIR) + "/drivers/wire/" + page);
    std::string line;
    while (std::getline(file, line) && !line.starts_with(beginning)) {}
    std::getline(file, line);
    std::getline(file, line);
    return line.substr(line.find_first_not_of(' '));
}

std::vector<Frame> decode(StreamDecoder& decoder, const Bytes& bytes, std::size_t chunk = 4096) {
    std::vector<Frame> frames;
    Frame frame;
    std::uint64_t t_ns = 1;
    for (std::size_t at = 0; at < bytes.size(); at += chunk, ++t_ns) {
        decoder.push({bytes.data() + at, std::min(chunk, bytes.size() - at)}, t_ns);
        while (decoder.next(frame)) frames.push_back(frame);
    }
    return frames;
}

Frame frame_of(std::uint32_t sequence, std::initializer_list<double> channels) {
    Frame frame;
    frame.sequence = sequence;
    for (const double value : channels) frame.channel[frame.n_channels++] = value;
    return frame;
}

// ---- both, over one description each ---------------------------------------------------------------------------------

struct Wire {
    std::string name;
    std::function<std::unique_ptr<StreamDecoder>(LinkCounts&)> decoder;
    std::function<Bytes(const Frame&)> encode;
};

const AsciiFormat kChecked{8, true, true, false};

Wire cobs() {
    return {"cobs", [](LinkCounts& c) { return std::make_unique<CobsDecoder>(c); },
            [](const Frame& f) {
                std::array<std::uint8_t, kCobsMostEncoded> out;
                return Bytes(out.begin(), out.begin() + std::ptrdiff_t(encode_cobs(f, 24, out)));
            }};
}
Wire lines() {
    return {"lines", [](LinkCounts& c) { return std::make_unique<AsciiDecoder>(kChecked, c); },
            [](const Frame& f) {
                std::array<char, kAsciiMostBytes * 2> out;
                return bytes_of({out.data(), encode_ascii(f, kChecked, out)});
            }};
}

class BothFormats : public testing::TestWithParam<Wire> {
protected:
    // Frame `n` of a stream, its channels known.
    static Frame frame(std::uint32_t n) {
        Frame f;
        f.sequence = n;
        f.n_channels = 8;
        for (std::uint32_t k = 0; k < 8; ++k) f.channel[k] = double(int(n * 7919 + k * 104729) % 1000000);
        return f;
    }
    Bytes stream(std::uint32_t first, std::uint32_t count, std::vector<std::size_t>* starts = nullptr) const {
        Bytes all;
        for (std::uint32_t n = first; n < first + count; ++n) {
            if (starts != nullptr) starts->push_back(all.size());
            const Bytes one = GetParam().encode(frame(n));
            all.insert(all.end(), one.begin(), one.end());
        }
        return all;
    }
    // Right frames only, in order; returns how many.
    static std::size_t check(const std::vector<Frame>& frames) {
        for (std::size_t i = 0; i < frames.size(); ++i) {
            const Frame expected = frame(frames[i].sequence);
            for (std::size_t k = 0; k < 8; ++k) EXPECT_EQ(frames[i].channel[k], expected.channel[k]);
            EXPECT_TRUE(i == 0 || frames[i].sequence > frames[i - 1].sequence);
        }
        return frames.size();
    }
};

TEST_P(BothFormats, GiveTheSameWhateverTheChunks) {
    const Bytes bytes = stream(0, 200);
    for (const std::size_t chunk : {1, 2, 3, 7, 37, 38, 39, 100, 1000, 4096}) {
        LinkCounts counts;
        const auto decoder = GetParam().decoder(counts);
        EXPECT_EQ(check(decode(*decoder, bytes, chunk)), 200u) << chunk;
        EXPECT_EQ(counts[TACTILED_LINK_FRAMES], 200u);
        EXPECT_EQ(counts[TACTILED_LINK_BYTES], bytes.size());
        EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], 0u);
    }
}

TEST_P(BothFormats, AnyOneByteChangedCostsAtMostTwoFrames) {
    const Bytes good = stream(100, 6);
    for (std::size_t at = 0; at < good.size(); ++at) {
        for (const unsigned change : {1u, 0x80u, 0xFFu, unsigned(good[at])}) {  // the last one makes it zero
            Bytes bytes = good;
            bytes[at] = std::uint8_t(bytes[at] ^ change);
            LinkCounts counts;
            const auto decoder = GetParam().decoder(counts);
            const auto frames = decode(*decoder, bytes);
            EXPECT_GE(check(frames), 4u) << at;
            // What is missing within the stream is counted; the ends have no neighbour to tell.
            const auto span = frames.empty() ? 0 : frames.back().sequence - frames.front().sequence + 1;
            EXPECT_EQ(counts[TACTILED_LINK_LOST] + frames.size(), span) << at;
        }
    }
}

TEST_P(BothFormats, AnyOneByteLostOrDoubledCostsAtMostTwoFrames) {
    const Bytes good = stream(100, 6);
    for (std::size_t at = 0; at < good.size(); ++at) {
        for (const bool lost : {true, false}) {
            Bytes bytes = good;
            if (lost)
                bytes.erase(bytes.begin() + std::ptrdiff_t(at));
            else
                bytes.insert(bytes.begin() + std::ptrdiff_t(at), bytes[at]);
            LinkCounts counts;
            const auto decoder = GetParam().decoder(counts);
            EXPECT_GE(check(decode(*decoder, bytes)), 4u) << at << lost;
        }
    }
}

TEST_P(BothFormats, ACutFrameIsLostAndTheNextIsRight) {
    std::vector<std::size_t> starts;
    const Bytes good = stream(0, 10, &starts);
    for (std::size_t keep = 1; keep < starts[5] - starts[4]; ++keep) {  // frame 4 ends early, frame 5 follows at once
        Bytes bytes(good.begin(), good.begin() + std::ptrdiff_t(starts[4] + keep));
        bytes.insert(bytes.end(), good.begin() + std::ptrdiff_t(starts[5]), good.end());
        LinkCounts counts;
        const auto decoder = GetParam().decoder(counts);
        const auto frames = decode(*decoder, bytes);
        EXPECT_GE(check(frames), 8u) << keep;
        EXPECT_EQ(frames.back().sequence, 9u);
        EXPECT_EQ(counts[TACTILED_LINK_LOST], 10 - frames.size());
    }
}

TEST_P(BothFormats, NoiseBetweenFramesIsCountedAndMakesNoFrame) {
    std::mt19937 random(1);
    LinkCounts counts;
    const auto decoder = GetParam().decoder(counts);
    std::size_t right = 0;
    std::uint32_t n = 0;
    for (int round = 0; round < 200; ++round) {
        Bytes bytes;
        for (auto i = random() % 2000; i > 0; --i) bytes.push_back(std::uint8_t(random()));
        bytes.push_back(GetParam().name == "cobs" ? 0 : '\n');
        const Bytes good = stream(n, 3);
        n += 3;
        bytes.insert(bytes.end(), good.begin(), good.end());
        const auto frames = decode(*decoder, bytes);
        right += check(frames);
        EXPECT_EQ(frames.size(), 3u);
    }
    EXPECT_EQ(right, 600u);
    EXPECT_EQ(counts[TACTILED_LINK_LOST], 0u);
    EXPECT_GT(counts[TACTILED_LINK_SKIPPED], 100'000u);
}

TEST_P(BothFormats, GapsAreCountedRepeatsDroppedAndAWrapIsNeither) {
    const auto wrap = GetParam().name == "cobs" ? 0xFFFFu : 0xFFFFFFFFu;
    LinkCounts counts;
    const auto decoder = GetParam().decoder(counts);
    Bytes bytes;
    for (const std::uint32_t n : {wrap - 1, wrap, 0u, 1u, 1u, 0u, 5u, 6u}) {
        const Bytes one = GetParam().encode(frame(n));
        bytes.insert(bytes.end(), one.begin(), one.end());
    }
    const auto frames = decode(*decoder, bytes);
    ASSERT_EQ(frames.size(), 6u);
    EXPECT_EQ(counts[TACTILED_LINK_LOST], 3u);
    EXPECT_EQ(counts[TACTILED_LINK_REPEATED], 2u);
    EXPECT_EQ(frames[4].sequence, 5u);
    EXPECT_EQ(frames[4].lost, 3u);
    EXPECT_EQ(frames[5].lost, 0u);
}

TEST_P(BothFormats, ADeviceThatRestartsIsBelievedWithItsSecondFrame) {
    LinkCounts counts;
    const auto decoder = GetParam().decoder(counts);
    Bytes bytes = stream(20'000, 5);
    const Bytes again = stream(0, 5);
    bytes.insert(bytes.end(), again.begin(), again.end());
    const auto frames = decode(*decoder, bytes);
    ASSERT_EQ(frames.size(), 9u);
    EXPECT_EQ(frames[5].sequence, 1u);
    EXPECT_EQ(counts[TACTILED_LINK_LOST], 0u);
}

TEST_P(BothFormats, TheStampIsThatOfTheLastByte) {
    const Bytes bytes = stream(0, 1);
    LinkCounts counts;
    const auto decoder = GetParam().decoder(counts);
    const auto frames = decode(*decoder, bytes, 1);  // stamps 1, 2, 3 ... byte by byte
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(frames[0].t_ns, bytes.size());
}

TEST_P(BothFormats, AFirstPartialFrameIsDroppedQuietly) {
    std::vector<std::size_t> starts;
    const Bytes good = stream(0, 4, &starts);
    for (std::size_t skip = 1; skip < starts[1]; ++skip) {
        LinkCounts counts;
        const auto decoder = GetParam().decoder(counts);
        const auto frames = decode(*decoder, Bytes(good.begin() + std::ptrdiff_t(skip), good.end()));
        EXPECT_EQ(check(frames), 3u);
        EXPECT_EQ(counts[TACTILED_LINK_BAD_CHECKSUM] + counts[TACTILED_LINK_BAD_LENGTH] + counts[TACTILED_LINK_BAD_VALUE],
                  0u);
        EXPECT_TRUE(counts[TACTILED_LINK_SKIPPED] > 0 || skip == starts[1] - 1);  // a delimiter alone is an empty frame
    }
}

INSTANTIATE_TEST_SUITE_P(Wire, BothFormats, testing::Values(cobs(), lines()),
                         [](const auto& wire) { return wire.param.name; });

// ---- binary frames ---------------------------------------------------------------------------------------------------

TEST(CobsFrame, TheExampleOfItsPageIsRight) {
    LinkCounts counts;
    CobsDecoder decoder(counts);
    const auto frames = decode(decoder, hex(line_after("cobs_frame.md", "On the wire:")));
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(frames[0].sequence, 5u);
    EXPECT_EQ(frames[0].n_channels, 3);
    EXPECT_EQ(frames[0].channel[0], 1);
    EXPECT_EQ(frames[0].channel[1], -2);
    EXPECT_EQ(frames[0].channel[2], 256);
    EXPECT_EQ(frames[0].device_time_us, 0u);
}

TEST(CobsFrame, CarriesEveryChannelCountBothWidthsMissingTimeAndRails) {
    for (const int bits : {24, 32})
        for (unsigned n = 1; n <= kMaxChannels; ++n) {
            Frame sent;
            sent.sequence = n;
            sent.device = std::uint16_t(n % kCobsMostDevices);
            sent.device_time_us = 4'000'000'000u + n;
            sent.n_channels = std::uint8_t(n);
            const double top = bits == 24 ? 8388607.0 : 2147483647.0;
            for (unsigned k = 0; k < n; ++k) sent.channel[k] = k % 3 == 0 ? top : k % 3 == 1 ? -top - 1 : double(k) - 10;
            if (n > 2) sent.missing = 1u << (n - 1);
            std::array<std::uint8_t, kCobsMostEncoded> out;
            const std::size_t size = encode_cobs(sent, bits, out);
            LinkCounts counts;
            CobsDecoder decoder(counts);
            const auto frames = decode(decoder, Bytes(out.begin(), out.begin() + std::ptrdiff_t(size)));
            ASSERT_EQ(frames.size(), 1u) << n;
            EXPECT_EQ(frames[0].device, sent.device);
            EXPECT_EQ(frames[0].device_time_us, sent.device_time_us);
            EXPECT_EQ(frames[0].missing, sent.missing);
            for (unsigned k = 0; k < n; ++k) {
                const bool missing = (sent.missing >> k & 1u) != 0;
                EXPECT_EQ(std::isnan(frames[0].channel[k]), missing);
                EXPECT_TRUE(missing || frames[0].channel[k] == sent.channel[k]);
                EXPECT_EQ(frames[0].saturated >> k & 1u, !missing && k % 3 != 2 ? 1u : 0u);
            }
        }
}

TEST(CobsFrame, EachDeviceHasItsOwnSequence) {
    LinkCounts counts;
    CobsDecoder decoder(counts);
    Bytes bytes;
    for (std::uint32_t n = 0; n < 10; ++n)
        for (const std::uint16_t device : std::initializer_list<std::uint16_t>{3, 7}) {
            Frame f = frame_of(n * (device == 3u ? 1u : 2u), {1});
            f.device = device;
            std::array<std::uint8_t, kCobsMostEncoded> out;
            bytes.insert(bytes.end(), out.begin(), out.begin() + std::ptrdiff_t(encode_cobs(f, 24, out)));
        }
    EXPECT_EQ(decode(decoder, bytes).size(), 20u);
    EXPECT_EQ(counts[TACTILED_LINK_LOST], 9u);
}

TEST(CobsFrame, TheDevicesClockIsExtendedAcrossItsWrapAndARestartIsSeenByIt) {
    LinkCounts counts;
    CobsDecoder decoder(counts);
    Bytes bytes;
    const auto add = [&](std::uint32_t n, std::uint64_t time_us) {
        Frame f = frame_of(n, {1});
        f.device_time_us = time_us;
        std::array<std::uint8_t, kCobsMostEncoded> out;
        bytes.insert(bytes.end(), out.begin(), out.begin() + std::ptrdiff_t(encode_cobs(f, 24, out)));
    };
    add(1, 0xFFFFFF00u);
    add(2, 0x1'0000'0010u);  // sent as 0x10
    add(500, 20'000);
    add(0, 5);  // the clock went back: restarted, although 0 is behind 500
    const auto frames = decode(decoder, bytes);
    ASSERT_EQ(frames.size(), 4u);
    EXPECT_EQ(frames[1].device_time_us, 0x1'0000'0010u);
    EXPECT_EQ(frames[3].sequence, 0u);
    EXPECT_EQ(frames[3].lost, 0u);
}

TEST(CobsFrame, AnEndlessFrameCostsOneCount) {
    LinkCounts counts;
    CobsDecoder decoder(counts);
    Bytes bytes{0};
    bytes.resize(100'000, 0x55);
    bytes.push_back(0);
    EXPECT_TRUE(decode(decoder, bytes).empty());
    EXPECT_EQ(counts[TACTILED_LINK_BAD_LENGTH], 1u);
    EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], 100'000u);
}

// ---- text lines ------------------------------------------------------------------------------------------------------

std::vector<Frame> read_lines(const std::string& text, const AsciiFormat& format, LinkCounts& counts) {
    AsciiDecoder decoder(format, counts);
    return decode(decoder, bytes_of("\n" + text));  // the line's end before it: from here on lines are whole
}

TEST(AsciiLine, TheExampleOfItsPageIsRight) {
    LinkCounts counts;
    const auto frames = read_lines(line_after("ascii_line.md", "Frame 7 with") + "\n", {3, true, true, false}, counts);
    ASSERT_EQ(frames.size(), 1u) << counts[TACTILED_LINK_BAD_CHECKSUM];
    EXPECT_EQ(frames[0].sequence, 7u);
    EXPECT_EQ(frames[0].channel[0], 0.5);
    EXPECT_EQ(frames[0].missing, 2u);
    EXPECT_EQ(frames[0].channel[2], -12);
}

TEST(AsciiLine, TakesWhatArduinosPrint) {
    const AsciiFormat three{3, false, false, false};
    for (const std::string line : {"1,2.5,-3\n", "1, 2.5, -3\r\n", "1\t2.5\t-3\n", "1;2.5;-3\n", " 1  2.5 -3 \r\n",
                                   "+1,+2.5,-3e0\n", "1.0,25e-1,-3.\n"}) {
        LinkCounts counts;
        const auto frames = read_lines(line, three, counts);
        ASSERT_EQ(frames.size(), 1u) << line;
        EXPECT_EQ(frames[0].channel[0], 1) << line;
        EXPECT_EQ(frames[0].channel[1], 2.5) << line;
        EXPECT_EQ(frames[0].channel[2], -3) << line;
        EXPECT_FALSE(frames[0].has_sequence);
    }
}

TEST(AsciiLine, ChecksTheLineAsItWasSentAndKeepsEmptyEnds) {
    LinkCounts counts;
    EXPECT_EQ(read_lines(" 1,2,3*10\r\n", {3, true, false, false}, counts).size(), 1u)
        << "the leading blank is in the checksum";
    const auto frames = read_lines("\t1\t\n", {3, false, false, false}, counts);
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(frames[0].missing, 0b101u);
    EXPECT_EQ(frames[0].channel[1], 1);
}

TEST(AsciiLine, TellsWhyItDropsALine) {
    const AsciiFormat three{3, false, false, false}, checked{3, true, false, false};
    const auto kind = [](const std::string& line, const AsciiFormat& format) {
        LinkCounts counts;
        EXPECT_TRUE(read_lines(line, format, counts).empty()) << line;
        EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], line.size()) << line;
        for (const auto k : {TACTILED_LINK_BAD_CHECKSUM, TACTILED_LINK_BAD_LENGTH, TACTILED_LINK_BAD_VALUE})
            if (counts[k] == 1) return k;
        return TACTILED_LINK_BYTES;
    };
    for (const std::string line : {"1,2\n", "1,2,3,4\n", "1,2,3,\n"})
        EXPECT_EQ(kind(line, three), TACTILED_LINK_BAD_LENGTH) << line;
    for (const std::string line :
         {"1,x,3\n", "1,2,3x\n", "1,inf,3\n", "1,1e999,3\n", "1,0x10,3\n", "Hello\n", "1,--2,3\n", "1,+-2,3\n"})
        EXPECT_EQ(kind(line, three), TACTILED_LINK_BAD_VALUE) << line;
    for (const std::string line : {"1,2,3\n", "1,2,3*\n", "1,2,3*0\n", "1,2,3*FF\n", "1,2,3*0G\n", "1,2,3*300\n"})
        EXPECT_EQ(kind(line, checked), TACTILED_LINK_BAD_CHECKSUM) << line;
    EXPECT_EQ(kind("1,2,3*00\n", three), TACTILED_LINK_BAD_CHECKSUM);  // wrong where none is required
    EXPECT_EQ(kind(std::string(600, '1') + "\n", three), TACTILED_LINK_BAD_LENGTH);
    EXPECT_EQ(kind("# tactile v1\n", three), TACTILED_LINK_BYTES);
}

TEST(AsciiLine, EveryDoubleSurvivesTheWire) {
    std::mt19937_64 random(2);
    const AsciiFormat format{1, true, false, false};
    LinkCounts counts;
    AsciiDecoder decoder(format, counts);
    (void)decode(decoder, bytes_of("\n"));
    int checked = 0;
    for (int i = 0; i < 20'000; ++i) {
        const std::uint64_t bits = random();
        double value;
        std::memcpy(&value, &bits, sizeof value);
        if (!std::isfinite(value)) continue;
        std::array<char, kAsciiMostBytes * 2> out;
        const auto frames = decode(decoder, bytes_of({out.data(), encode_ascii(frame_of(0, {value}), format, out)}));
        ASSERT_EQ(frames.size(), 1u) << value;
        EXPECT_EQ(std::memcmp(&frames[0].channel[0], &value, sizeof value), 0);
        ++checked;
    }
    EXPECT_GT(checked, 19'000);
}

TEST(AsciiLine, ReadsSequenceAndTimeColumns) {
    LinkCounts counts;
    const auto frames = read_lines("5,1000,1.5\n6,2000,1.6\n9,3000,1.7\n", {1, false, true, true}, counts);
    ASSERT_EQ(frames.size(), 3u);
    EXPECT_EQ(frames[1].device_time_us, 2000u);
    EXPECT_EQ(frames[2].lost, 2u);
    EXPECT_EQ(frames[2].channel[0], 1.7);
}

// ---- the FT 300's stream ----

Bytes ft300(double fx_N, double mz_Nm) {
    Frame frame;
    frame.channel[0] = fx_N;
    frame.channel[5] = mz_Nm;
    std::array<std::uint8_t, kFt300Bytes> out;
    encode_ft300(frame, out);
    return {out.begin(), out.end()};
}

TEST(Ft300, AsksWithTheWriteOfTheManualAndStopsWith50TimesFF) {
    LinkCounts counts;
    const Ft300Decoder decoder(9, counts);
    const auto start = decoder.start_bytes(), stop = decoder.stop_bytes();
    EXPECT_EQ(Bytes(start.begin(), start.end()), hex("09 10 01 9A 00 01 02 02 00 CD CA"));
    EXPECT_EQ(Bytes(stop.begin(), stop.end()), Bytes(50, 0xFF));
}

TEST(Ft300, ReadsLittleEndianHundredthsOfANewtonAndThousandthsOfANewtonMetre) {
    LinkCounts counts;
    Ft300Decoder decoder(9, counts);
    const Bytes bytes = ft300(-12.34, 1.5);
    EXPECT_EQ(Bytes(bytes.begin(), bytes.begin() + 4), hex("20 4E 2E FB"));
    const auto frames = decode(decoder, bytes);
    ASSERT_EQ(frames.size(), 1u);
    ASSERT_EQ(frames[0].n_channels, 6);
    EXPECT_DOUBLE_EQ(frames[0].channel[0], -12.34);  // N
    EXPECT_DOUBLE_EQ(frames[0].channel[5], 1.5);     // Nm
}

TEST(Ft300, FindsFramesAfterTheAnswerToItsRequestInNoiseAndInsideABrokenFrame) {
    Bytes bytes = hex("09 10 01 9A 00 01 20 9F 20 20 4E 01");
    const std::size_t before = bytes.size();
    const Bytes good = ft300(1, 2), other = ft300(3, 4);
    bytes.insert(bytes.end(), good.begin(), good.end());  // stands inside what begins with the 20 4E above
    bytes.insert(bytes.end(), other.begin(), other.end());
    for (const std::size_t chunk : {1u, 3u, 4096u}) {
        LinkCounts counts;
        Ft300Decoder decoder(9, counts);
        const auto frames = decode(decoder, bytes, chunk);
        ASSERT_EQ(frames.size(), 2u);
        EXPECT_EQ(frames[0].channel[0], 1);
        EXPECT_EQ(frames[1].channel[5], 4);
        EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], before);
        EXPECT_EQ(counts[TACTILED_LINK_BAD_CHECKSUM], 1u);
    }
}

TEST(Ft300, AnyBitFlippedCostsThatFrameAlone) {
    for (std::size_t bit = 0; bit < 8 * kFt300Bytes; ++bit) {
        Bytes bytes = ft300(1, 2);
        bytes[bit / 8] = std::uint8_t(bytes[bit / 8] ^ 1u << bit % 8);
        const Bytes next = ft300(5, 6);
        bytes.insert(bytes.end(), next.begin(), next.end());
        LinkCounts counts;
        Ft300Decoder decoder(9, counts);
        const auto frames = decode(decoder, bytes);
        ASSERT_EQ(frames.size(), 1u) << "bit " << bit;
        EXPECT_EQ(frames[0].channel[0], 5);
    }
}

// ---- the KMS 40's lines ----

TEST(Kms40, ReadsItsLinesAndPassesOverTheAnswersToCommands) {
    for (const std::size_t chunk : {1u, 5u, 4096u}) {
        LinkCounts counts;
        Kms40Decoder decoder(counts);
        const auto frames =
            decode(decoder, bytes_of("L1\nF={-1.5,0.25,3,0.001,-2e-3,0},123\r\nF={4,5,6,7,8,9},124\n"), chunk);
        ASSERT_EQ(frames.size(), 2u);
        ASSERT_EQ(frames[0].n_channels, 6);
        EXPECT_EQ(frames[0].channel[0], -1.5);   // N
        EXPECT_EQ(frames[0].channel[4], -2e-3);  // Nm
        EXPECT_EQ(frames[1].channel[5], 9);
        EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], 3u);
        EXPECT_EQ(counts[TACTILED_LINK_BAD_VALUE], 0u);
    }
}

TEST(Kms40, TakesNothingFromALineThatIsNotWhole) {
    for (const char* line :
         {"F={1,2,3,4,5},1", "F={1,2,3,4,5,6,7},1", "F={1,2,3,4,5,6}", "F={1,2,3,4,5,6},", "F={1,2,3,4,5,6},1x",
          "F={1,2,,4,5,6},1", "F={1,2,nan,4,5,6},1", "F={1,2,inf,4,5,6},1", "F={", "F={1,2,3,4,5,6,1"}) {
        LinkCounts counts;
        Kms40Decoder decoder(counts);
        EXPECT_TRUE(decode(decoder, bytes_of(std::string(line) + "\n")).empty()) << line;
        EXPECT_EQ(counts[TACTILED_LINK_BAD_VALUE], 1u) << line;
    }
    LinkCounts counts;
    Kms40Decoder decoder(counts);
    EXPECT_TRUE(decode(decoder, bytes_of("F={" + std::string(300, '1') + "\n")).empty());
    EXPECT_EQ(counts[TACTILED_LINK_BAD_LENGTH], 1u);
}

}  // namespace
}  // namespace tactiled
