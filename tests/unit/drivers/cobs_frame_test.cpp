// Binary frames: the properties on their page, and numbers, saturation limits, clocks and noise.
#include <cmath>
#include <limits>
#include <random>

#include "drivers/wire/cobs_frame.hpp"
#include "tests/unit/drivers/wire_bytes.hpp"

namespace tactiled {
namespace {

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

TEST(CobsFrame, CarriesEveryChannelCountBothWidthsMissingTimeAndSaturationLimits) {
    for (const int bits : {24, 32})
        for (unsigned n = 1; n <= kMaxChannels; ++n) {
            Frame sent;
            sent.sequence = n;
            sent.device = std::uint16_t(n % kCobsMaxDevices);
            sent.device_time_us = 4'000'000'000u + n;
            sent.n_channels = std::uint8_t(n);
            const double top = bits == 24 ? 8388607.0 : 2147483647.0;
            for (unsigned k = 0; k < n; ++k) sent.channel[k] = k % 3 == 0 ? top : k % 3 == 1 ? -top - 1 : double(k) - 10;
            if (n > 2) sent.missing = 1u << (n - 1);
            std::array<std::uint8_t, kCobsMaxEncoded> out;
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
            std::array<std::uint8_t, kCobsMaxEncoded> out;
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
        std::array<std::uint8_t, kCobsMaxEncoded> out;
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
    bytes.clear();  // half of the range is no wrap
    add(1, 0x7FFFFFF0u);
    add(2, 0x80000010u);
    const auto halves = decode(decoder, bytes);
    ASSERT_EQ(halves.size(), 2u);
    EXPECT_EQ(halves[1].device_time_us - halves[0].device_time_us, 0x20u);
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

}  // namespace
}  // namespace tactiled
