// Recordings: the reader returns the writer's data, and the intact part of a truncated or damaged file.
#include <gtest/gtest.h>

#include <unistd.h>

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/reader.hpp"
#include "drivers/mcap/writer.hpp"

namespace tactiled::mcap {
namespace {

std::string scratch_path() {
    const char* folder = std::getenv("TMPDIR");
    return std::string(folder != nullptr ? folder : "/tmp") + "/mcap_test." + std::to_string(::getpid()) + ".mcap";
}

Frame any_frame(std::mt19937_64& random) {
    Frame frame;
    frame.t_ns = random();
    frame.device_time_us = random();
    frame.sequence = std::uint32_t(random());
    frame.missing = std::uint32_t(random());
    frame.saturated = std::uint32_t(random());
    frame.lost = std::uint32_t(random());
    frame.device = std::uint16_t(random());
    frame.has_sequence = random() % 2 == 0;
    frame.n_channels = std::uint8_t(random() % (kMaxChannels + 1));
    for (std::size_t k = 0; k < frame.n_channels; ++k) frame.channel[k] = std::bit_cast<double>(random());
    return frame;
}

bool same_bits(const Frame& a, const Frame& b) {
    for (std::size_t k = 0; k < a.n_channels; ++k)
        if (std::bit_cast<std::uint64_t>(a.channel[k]) != std::bit_cast<std::uint64_t>(b.channel[k])) return false;
    return a.t_ns == b.t_ns && a.device_time_us == b.device_time_us && a.sequence == b.sequence && a.missing == b.missing &&
           a.saturated == b.saturated && a.lost == b.lost && a.device == b.device && a.has_sequence == b.has_sequence &&
           a.n_channels == b.n_channels;
}

constexpr int kFrames = 60, kFramesOfChunk = 7;

// A file of frames on channel 0, seven a chunk, and an attachment.
std::string recording(const std::vector<Frame>& frames) {
    const std::string path = scratch_path();
    {
        Writer writer(path, true);
        const auto schema = writer.add_schema(std::string(kFrameSchema), "ros2msg", std::string(kFrameDefinition));
        const auto channel = writer.add_channel(schema, "/n/link/usb0/frames", "cdr", {{std::string(kLinkKey), "usb0"}});
        writer.attach("tactiled.toml", "application/toml", "[node]\n", 5);
        std::string message;
        for (std::size_t i = 0; i < frames.size(); ++i) {
            encode_frame(frames[i], i, message);
            writer.message(channel, std::uint32_t(i), i, message);
            if (i % kFramesOfChunk == kFramesOfChunk - 1) writer.flush();
        }
        writer.close();
    }
    std::ifstream file(path, std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(file), {}};
    std::remove(path.c_str());
    return bytes;
}

std::vector<Frame> frames_of(Reader& reader) {
    std::vector<Frame> frames;
    Frame frame;
    while (const auto message = reader.next())
        if (decode_frame(message->data, frame)) frames.push_back(frame);
    return frames;
}

struct Mcap : testing::Test {
    Mcap() {
        std::mt19937_64 random(11);
        for (int i = 0; i < kFrames; ++i) frames.push_back(any_frame(random));
        bytes = recording(frames);
    }
    std::vector<Frame> frames;
    std::string bytes;
};

TEST_F(Mcap, GivesBackEveryBitOfEveryFrame) {
    Reader reader(bytes), another(bytes);
    const std::vector<Frame> back = frames_of(reader);
    ASSERT_EQ(back.size(), frames.size());
    for (std::size_t i = 0; i < back.size(); ++i) EXPECT_TRUE(same_bits(back[i], frames[i])) << i;
    EXPECT_EQ(reader.why(), "");
    ASSERT_EQ(reader.attachments().size(), 1u);
    EXPECT_EQ(reader.attachments()[0].data, "[node]\n");
    const auto first = another.next();
    EXPECT_EQ(first->channel->topic, "/n/link/usb0/frames");
    EXPECT_EQ(first->channel->metadata.at("link"), "usb0");
}

TEST_F(Mcap, CutAnywhereItLosesTheLastChunkAtMost) {
    std::size_t before = 0;
    for (std::size_t size = 0; size < bytes.size(); ++size) {
        const std::string cut = bytes.substr(0, size);
        Reader reader(cut);
        const std::vector<Frame> back = frames_of(reader);
        ASSERT_GE(back.size(), before);
        ASSERT_LE(back.size(), before + kFramesOfChunk);
        before = back.size();
        for (std::size_t i = 0; i < back.size(); ++i) ASSERT_TRUE(same_bits(back[i], frames[i]));
        ASSERT_TRUE(back.size() == frames.size() || reader.why() != "") << size;
    }
    EXPECT_EQ(before, frames.size());
}

TEST_F(Mcap, AFlippedBitCostsOneChunkAndIsSaid) {
    std::mt19937_64 random(3);
    for (int i = 0; i < 3000; ++i) {
        std::string damaged = bytes;
        damaged[random() % damaged.size()] ^= char(1u << random() % 8);
        Reader reader(damaged);
        const std::vector<Frame> back = frames_of(reader);
        ASSERT_LE(back.size(), frames.size());
        // The messages are the recorded ones, in their order: never another value.
        std::size_t at = 0;
        for (const Frame& frame : back) {
            while (at < frames.size() && !same_bits(frame, frames[at])) ++at;
            ASSERT_LT(at, frames.size()) << "a frame that was not recorded";
        }
    }
}

TEST_F(Mcap, IsReadWhateverTheBytesAre) {
    std::mt19937_64 random(5);
    for (int i = 0; i < 3000; ++i) {
        std::string any = bytes.substr(0, 300 + random() % (bytes.size() - 300));
        for (int n = 0; n < 20; ++n) any[8 + random() % (any.size() - 8)] = char(random());
        Reader reader(any);
        Frame frame;
        int messages = 0;
        while (const auto message = reader.next()) {
            (void)decode_frame(message->data, frame);
            ASSERT_LT(++messages, 10000);
        }
    }
    Reader none("no MCAP at all");
    EXPECT_FALSE(none.next().has_value());
    EXPECT_EQ(none.why(), "is no MCAP file");
}

TEST_F(Mcap, AMessageOfTooManyChannelsIsNoFrame) {
    std::string message;
    encode_frame(frames[0], 0, message);
    Frame frame;
    for (std::size_t size = 0; size < message.size(); ++size)
        EXPECT_FALSE(decode_frame(std::span(message.data(), size), frame)) << size;
    EXPECT_TRUE(decode_frame(message, frame));
    const std::uint32_t many = kMaxChannels + 1;
    std::memcpy(message.data() + 4 + 8 + 16 + 16 + 4, &many, sizeof many);
    EXPECT_FALSE(decode_frame(message, frame));
}

TEST(McapWriter, DoesNotReplaceAFileUnlessAsked) {
    const std::string path = scratch_path();
    { Writer writer(path, true); }
    EXPECT_THROW(Writer(path, false), SetupError);
    std::remove(path.c_str());
    EXPECT_THROW(Writer("/nowhere/at/all.mcap", true), SetupError);
}

}  // namespace
}  // namespace tactiled::mcap
