// Text lines: the properties on their page, and dropped lines with their reasons.
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "drivers/wire/ascii_line.hpp"
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

}  // namespace
}  // namespace tactiled
