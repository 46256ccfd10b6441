// Both wire formats: the promises on their pages, against bytes that were cut, changed, doubled and mixed with noise.
#include <functional>
#include <memory>
#include <random>

#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "tests/unit/drivers/wire_bytes.hpp"

namespace tactiled {
namespace {

struct Wire {
    std::string name;
    std::function<std::unique_ptr<StreamDecoder>(LinkCounts&)> decoder;
    std::function<Bytes(const Frame&)> encode;
};

const AsciiFormat kChecked{8, true, true, false};

Wire cobs() {
    return {"cobs", [](LinkCounts& c) { return std::make_unique<CobsDecoder>(c); },
            [](const Frame& f) {
                std::array<std::uint8_t, kCobsMaxEncoded> out;
                return Bytes(out.begin(), out.begin() + std::ptrdiff_t(encode_cobs(f, 24, out)));
            }};
}
Wire lines() {
    return {"lines", [](LinkCounts& c) { return std::make_unique<AsciiDecoder>(kChecked, c); },
            [](const Frame& f) {
                std::array<char, kAsciiMaxBytes * 2> out;
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
    // Checks that there are only right frames, in order; returns their number.
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
    for (const std::size_t chunk : {1u, 2u, 3u, 7u, 37u, 38u, 39u, 100u, 1000u, 4096u}) {
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
            // Frames missing within the stream are counted; the ends have no neighbour that would show it.
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

TEST_P(BothFormats, TheTimestampIsThatOfTheLastByte) {
    const Bytes bytes = stream(0, 1);
    LinkCounts counts;
    const auto decoder = GetParam().decoder(counts);
    const auto frames = decode(*decoder, bytes, 1);  // times 1, 2, 3 ... byte by byte
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(frames[0].t_ns, bytes.size());
}

TEST_P(BothFormats, FramesThatWaitedTogetherAreAsFarApartAsTheirBytes) {
    LinkCounts counts;
    const auto decoder = GetParam().decoder(counts);
    Bytes bytes;
    std::vector<std::size_t> ends;
    for (std::uint32_t n = 1; n <= 10; ++n) {
        const Bytes one = GetParam().encode(frame(n));
        bytes.insert(bytes.end(), one.begin(), one.end());
        ends.push_back(bytes.size());
    }
    decoder->push(bytes, 2'000'000, 1'000'000);
    Frame f;
    for (const std::size_t end : ends) {
        ASSERT_TRUE(decoder->next(f));
        EXPECT_NEAR(double(f.t_ns), 1e6 + 1e6 * double(end) / double(bytes.size()), double(bytes.size()));
    }
    EXPECT_EQ(f.t_ns, 2'000'000u) << "the newest one";
    decoder->push(GetParam().encode(frame(11)), 2'500'000, 1'500'000);
    ASSERT_TRUE(decoder->next(f));
    EXPECT_EQ(f.t_ns, 2'500'000u);
    // No timestamp is before an earlier one, whatever times the caller passes.
    Bytes two = GetParam().encode(frame(12)), more = GetParam().encode(frame(13));
    two.insert(two.end(), more.begin(), more.end());
    decoder->push(two, 2'600'000, 1);
    ASSERT_TRUE(decoder->next(f));
    EXPECT_GT(f.t_ns, 2'500'000u);
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

}  // namespace
}  // namespace tactiled
