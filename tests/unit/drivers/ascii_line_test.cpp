// Text lines: the properties on their page, and dropped lines with their reasons.
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/stream_format.hpp"
#include "tests/unit/drivers/wire_bytes.hpp"

namespace tactiled {
namespace {

std::vector<Frame> read_lines(const std::string& text, const AsciiFormat& format, LinkCounts& counts) {
    AsciiDecoder decoder(format, counts);
    return decode(decoder, bytes_of("\n" + text));  // the line's end before it: from here on lines are whole
}

TEST(AsciiLine, TheExampleOfItsPageIsRight) {
    LinkCounts counts;
    const auto frames = read_lines(line_after("ascii_line.md", "Frame 7 with") + "\n", {3, true, true, false, true}, counts);
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
    const std::string digits(600, '1');
    EXPECT_EQ(kind(digits + "\n", three), TACTILED_LINK_BAD_LENGTH);
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
        std::array<char, kAsciiMaxBytes * 2> out;
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

constexpr AsciiFormat kNone{.channels = 1}, kXor{.channels = 1, .checksum = true},
    kCrc{.channels = 1, .checksum = true, .crc16 = true};

// The bytes with which a simulated device answers `request`.
std::string answer_to(const std::string& request, std::uint32_t time_us, const AsciiFormat& format) {
    const StreamSettings settings{.checksum = format.checksum, .crc16 = format.crc16};
    const auto bytes = StreamFormats::find("lines")->answer(request, time_us, settings);
    return {bytes.begin(), bytes.end()};
}

std::string line_of(const Frame& frame, const AsciiFormat& format) {
    std::array<char, kAsciiMaxBytes * 2> out;
    return {out.data(), encode_ascii(frame, format, out)};
}

void expect_no_errors(const LinkCounts& counts) {
    for (const auto kind : {TACTILED_LINK_SKIPPED, TACTILED_LINK_BAD_CHECKSUM, TACTILED_LINK_BAD_LENGTH,
                            TACTILED_LINK_BAD_VALUE, TACTILED_LINK_REPEATED})
        EXPECT_EQ(counts[kind], 0u) << kind;
}

TEST(AsciiEcho, IsReadInAnyChunkingWithEachChecksumAndIsNoFrame) {
    for (const AsciiFormat& format : {kNone, kXor, kCrc}) {
        const std::string text = "\n" + line_of(frame_of(0, {1}), format) + answer_to("?4294967295", 4'000'000'000, format) +
                                 line_of(frame_of(0, {2}), format);
        for (std::size_t chunk = 1; chunk <= text.size(); ++chunk) {
            LinkCounts counts;
            AsciiDecoder decoder(format, counts);
            EXPECT_EQ(decode(decoder, bytes_of(text), chunk).size(), 2u);
            const auto echo = decoder.take_echo();
            EXPECT_EQ(echo.number, 4'294'967'295u) << text;
            EXPECT_EQ(echo.time_us, 4'000'000'000u);
            EXPECT_EQ(decoder.take_echo().number, 0u) << "it is given once";
            EXPECT_EQ(counts[TACTILED_LINK_BYTES], text.size());
            EXPECT_EQ(counts[TACTILED_LINK_FRAMES], 2u);
            expect_no_errors(counts);
        }
    }
}

TEST(AsciiEcho, BelongsToTheFrameAfterIt) {
    LinkCounts counts;
    AsciiDecoder decoder(kNone, counts);
    decoder.push(bytes_of("\n1\n!7,70\n2\n3\n!8,80\n"), 1);
    Frame frame;
    for (const std::uint32_t number : {0u, 7u, 0u}) {
        ASSERT_TRUE(decoder.next(frame));
        EXPECT_EQ(decoder.take_echo().number, number) << frame.channel[0];
    }
    EXPECT_FALSE(decoder.next(frame));
    decoder.reset();
    EXPECT_EQ(decoder.take_echo().number, 0u) << "an answer of the opening before";
}

TEST(AsciiEcho, TakesTheTimeModulo32Bits) {
    for (const std::string line : {"!5,4294967299\n", "!5, 3\r\n", " !5,3\n"}) {
        LinkCounts counts;
        AsciiDecoder decoder(kNone, counts);
        EXPECT_TRUE(decode(decoder, bytes_of(line)).empty());
        const auto echo = decoder.take_echo();
        EXPECT_EQ(echo.number, 5u) << line;
        EXPECT_EQ(echo.time_us, 3u) << line;
        expect_no_errors(counts);
    }
}

TEST(AsciiEcho, ThatIsDamagedIsCountedAndNotTaken) {
    const auto count_of = [](const std::string& line, const AsciiFormat& format, tactiled_link_count kind) {
        LinkCounts counts;
        AsciiDecoder decoder(format, counts);
        EXPECT_TRUE(decode(decoder, bytes_of("\n" + line + "\n")).empty()) << line;
        EXPECT_EQ(decoder.take_echo().number, 0u) << line;
        EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], line.size() + 1) << line;
        return counts[kind];
    };
    for (const std::string line : {"!", "!,", "!5", "!5,", "!,5", "!5,6,7", "!5;6", "!-5,6", "!5,-6", "!5,6.5", "!x,6",
                                   "!!5,6", "!4294967296,6", "!5,18446744073709551616", "!99999999999999999999,6"})
        EXPECT_EQ(count_of(line, kNone, TACTILED_LINK_BAD_VALUE), 1u) << line;
    EXPECT_EQ(count_of("!" + std::string(600, '5'), kNone, TACTILED_LINK_BAD_LENGTH), 1u);
    for (const AsciiFormat& format : {kXor, kCrc}) {
        EXPECT_EQ(count_of("!5,6", format, TACTILED_LINK_BAD_CHECKSUM), 1u) << "without its checksum";
        std::string line = answer_to("?5", 6789, format);
        line.pop_back();
        for (std::size_t k = 1; k < line.size(); ++k) {
            std::string damaged = line;
            damaged[k] = char(damaged[k] ^ 1);
            EXPECT_EQ(count_of(damaged, format, TACTILED_LINK_BAD_CHECKSUM), 1u) << damaged;
        }
    }
}

TEST(AsciiEcho, ADeviceAnswersRequestsAlone) {
    EXPECT_EQ(answer_to("?12", 345, kNone), "!12,345\n");
    for (const std::string line : {"", "?", "12", "?x", "?4294967296", "?12 ", "!12,345", "#?12"})
        EXPECT_EQ(answer_to(line, 1, kNone), "") << line;
}

TEST(AsciiEcho, IsNoBadLineForIdentify) {
    std::string text = "\n";
    for (int i = 0; i < 100; ++i) {
        text += std::to_string(i) + "," + std::to_string(i * 10'000) + ",1.5\n";
        if (i % 10 == 0) text += "!" + std::to_string(i) + "," + std::to_string(i * 10'000) + "\n";
    }
    const auto guess = StreamFormats::find("lines")->recognise(bytes_of(text), 1);
    ASSERT_TRUE(guess);
    EXPECT_EQ(guess->good, 100u);
    EXPECT_EQ(guess->bad, 0u) << guess->last_bad;
}

}  // namespace
}  // namespace tactiled
