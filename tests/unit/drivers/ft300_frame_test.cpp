// The FT 300's stream.
#include <cmath>

#include "tests/unit/drivers/ft300_bytes.hpp"
#include "tests/unit/drivers/wire_bytes.hpp"

namespace tactiled {
namespace {

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

TEST(Ft300, AnAxisAtTheEndOfItsRangeIsSaturated) {
    Bytes bytes = ft300(0, 0);
    const auto put = [&](std::size_t axis, int number) {
        bytes[2 + 2 * axis] = std::uint8_t(number);
        bytes[3 + 2 * axis] = std::uint8_t(number >> 8);
    };
    put(1, 32767);
    put(2, -32768);
    put(3, -32767);
    const std::uint16_t crc = modbus_crc({bytes.data(), kFt300Bytes - 2});
    bytes[kFt300Bytes - 2] = std::uint8_t(crc);
    bytes[kFt300Bytes - 1] = std::uint8_t(crc >> 8);
    LinkCounts counts;
    Ft300Decoder decoder(9, counts);
    const auto frames = decode(decoder, bytes);
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(frames[0].saturated, 0b000110u);
}

}  // namespace
}  // namespace tactiled
