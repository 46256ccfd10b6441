// Lines of hexadecimal numbers, as printed by a DynPick.
#include "drivers/wire/hex_line.hpp"
#include "tests/unit/drivers/wire_bytes.hpp"

namespace tactiled {
namespace {

const HexFormat kDynPick{6, 4, HexFormat::Digit::counter, 0x3FFF, "S", "E"};

std::string line(unsigned digit, const std::string& first = "2013") {
    return std::to_string(digit) + first + "1FFA2100200020011fff\r\n";
}

TEST(HexLine, ReadsNumbersOfFixedWidthWhateverTheChunks) {
    for (const std::size_t chunk : {1u, 5u, 4096u}) {
        LinkCounts counts;
        HexDecoder decoder(kDynPick, counts);
        const auto frames = decode(decoder, bytes_of(line(8) + line(9) + line(0)), chunk);
        ASSERT_EQ(frames.size(), 3u);
        ASSERT_EQ(frames[0].n_channels, 6);
        EXPECT_EQ(frames[0].channel[0], 0x2013);
        EXPECT_EQ(frames[0].channel[5], 0x1FFF);
        EXPECT_EQ(frames[2].sequence, frames[0].sequence + 2);
        EXPECT_EQ(counts[TACTILED_LINK_LOST] + counts[TACTILED_LINK_REPEATED] + counts[TACTILED_LINK_SKIPPED], 0u);
    }
}

TEST(HexLine, ADigitThatCountsTellsWhatIsLostAndWhatCameTwice) {
    LinkCounts counts;
    HexDecoder decoder(kDynPick, counts);
    const auto frames = decode(decoder, bytes_of(line(7) + line(1) + line(1) + line(0) + line(1)));
    ASSERT_EQ(frames.size(), 4u);
    EXPECT_EQ(frames[1].lost, 3u);  // 8, 9, 0
    EXPECT_EQ(frames[2].lost, 8u);
    EXPECT_EQ(frames[3].lost, 0u);
    EXPECT_EQ(counts[TACTILED_LINK_LOST], 11u);
    EXPECT_EQ(counts[TACTILED_LINK_REPEATED], 1u);
    HexFormat ignored = kDynPick;
    ignored.first = HexFormat::Digit::ignored;
    LinkCounts none;
    HexDecoder other(ignored, none);
    EXPECT_EQ(decode(other, bytes_of(line(7) + line(1) + line(1))).size(), 3u);
    EXPECT_EQ(none[TACTILED_LINK_LOST], 0u);
}

TEST(HexLine, TakesNothingFromALineThatIsNotWhole) {
    const std::string good = line(1), digits(400, '1');
    for (const std::string& bad :
         {good.substr(1), good.substr(0, 20) + "\n", "1" + good, digits + "\n", std::string("\n")}) {
        LinkCounts counts;
        HexDecoder decoder(kDynPick, counts);
        EXPECT_EQ(decode(decoder, bytes_of(line(0) + bad + line(1))).size(), 2u) << bad;
        EXPECT_EQ(counts[TACTILED_LINK_BAD_LENGTH], 1u) << bad;
        EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], bad.size()) << bad;
    }
    for (const char* first :
         {"4000", "FFFF", "20-1", " 201", "20g0", "0x20"}) {  // above the converter's last code, or not digits
        LinkCounts counts;
        HexDecoder decoder(kDynPick, counts);
        EXPECT_EQ(decode(decoder, bytes_of(line(0) + line(1, first) + line(2))).size(), 2u) << first;
        EXPECT_EQ(counts[TACTILED_LINK_BAD_VALUE], 1u) << first;
        EXPECT_EQ(counts[TACTILED_LINK_LOST], 1u) << first;
    }
}

TEST(HexLine, TheFirstLineMayBeginInItsMiddleWithoutAComplaint) {
    LinkCounts counts;
    HexDecoder decoder(kDynPick, counts);
    EXPECT_EQ(decode(decoder, bytes_of(line(0).substr(9) + line(1))).size(), 1u);
    EXPECT_EQ(counts[TACTILED_LINK_BAD_LENGTH], 0u);
    decoder.reset();
    EXPECT_EQ(decode(decoder, bytes_of(line(7)))[0].lost, 0u);
}

TEST(HexLine, ANumberAtTheConvertersEndIsAtASaturationLimit) {
    LinkCounts counts;
    HexDecoder decoder(kDynPick, counts);
    const auto frames = decode(decoder, bytes_of(line(1, "0000") + line(2, "3FFF") + line(3, "3FFE")));
    ASSERT_EQ(frames.size(), 3u);
    EXPECT_EQ(frames[0].saturated, 1u);
    EXPECT_EQ(frames[1].saturated, 1u);
    EXPECT_EQ(frames[2].saturated, 0u);
}

TEST(HexLine, WithoutADigitAndWithEightIsReadToo) {
    LinkCounts counts;
    HexDecoder decoder({2, 8, HexFormat::Digit::none, 0xFFFFFFFF, "", ""}, counts);
    const auto frames = decode(decoder, bytes_of("0000000180000000\n"));
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(frames[0].channel[0], 1);
    EXPECT_EQ(frames[0].channel[1], 2147483648.0);
    EXPECT_FALSE(frames[0].has_sequence);
}

}  // namespace
}  // namespace tactiled
