// Messages of several CAN frames, with frames lost, doubled, out of order, late, and invalid.
#include "drivers/wire/isotp.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace tactiled {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Found = IsoTp::Found;

Bytes message_of(std::size_t size) {
    Bytes bytes(size);
    for (std::size_t k = 0; k < size; ++k) bytes[k] = std::uint8_t(k * 7 + 1);
    return bytes;
}

// Splits a message by ISO 15765-2 into frames of that many bytes; the last one unpadded.
std::vector<Bytes> frames_of(const Bytes& message, std::size_t max = 8) {
    if (message.size() <= 7) {
        Bytes one{std::uint8_t(message.size())};
        one.insert(one.end(), message.begin(), message.end());
        return {one};
    }
    if (message.size() + 2 <= max) {
        Bytes one{0, std::uint8_t(message.size())};
        one.insert(one.end(), message.begin(), message.end());
        return {one};
    }
    std::vector<Bytes> frames{{std::uint8_t(0x10 | message.size() >> 8), std::uint8_t(message.size())}};
    std::size_t at = 0;
    for (; frames[0].size() < max; ++at) frames[0].push_back(message[at]);
    for (unsigned n = 1; at < message.size(); ++n) {
        Bytes frame{std::uint8_t(0x20 | (n & 15))};
        for (; frame.size() < max && at < message.size(); ++at) frame.push_back(message[at]);
        frames.push_back(frame);
    }
    return frames;
}

class IsoTpTest : public testing::Test {
protected:
    Found take(const Bytes& frame, std::uint64_t after_ns = 1'000'000) { return receiver_.take(frame, t_ns_ += after_ns); }
    // Returns true if the frames result in that message.
    bool gives(const std::vector<Bytes>& frames, const Bytes& message) {
        Found found = Found::nothing;
        for (const Bytes& frame : frames) found = take(frame);
        return found == Found::message && Bytes(receiver_.message().begin(), receiver_.message().end()) == message;
    }
    IsoTp receiver_;
    std::uint64_t t_ns_ = 1'000'000'000;
};

TEST_F(IsoTpTest, GivesMessagesOfEverySizeInClassicAndFdFrames) {
    for (const std::size_t max : {8u, 12u, 64u})
        for (std::size_t size = 1; size <= IsoTp::kMaxBytes; ++size) {
            const Bytes message = message_of(size);
            ASSERT_TRUE(gives(frames_of(message, max), message)) << size << " bytes in frames of " << max;
        }
    EXPECT_EQ(receiver_.take_lost(), 0u);
}

TEST_F(IsoTpTest, AsksForTheOthersAndHasTheTimeOfTheFirst) {
    const auto frames = frames_of(message_of(20));
    ASSERT_EQ(take(frames[0]), Found::first);
    const std::uint64_t first_ns = t_ns_;
    EXPECT_EQ(receiver_.answer(), (std::array<std::uint8_t, 8>{0x30, 0, 0, 0xCC, 0xCC, 0xCC, 0xCC, 0xCC}));
    EXPECT_EQ(take(frames[1]), Found::nothing);
    EXPECT_EQ(take(frames[2]), Found::message);
    EXPECT_EQ(receiver_.t_ns(), first_ns);
}

TEST_F(IsoTpTest, AnyFrameLostDoubledOrSwappedCostsThatMessageAloneAndOnce) {
    const Bytes message = message_of(200);
    const auto frames = frames_of(message);
    for (std::size_t at = 1; at < frames.size(); ++at) {
        auto lost = frames, doubled = frames, swapped = frames;
        lost.erase(lost.begin() + long(at));
        doubled.insert(doubled.begin() + long(at), frames[at]);
        if (at + 1 < frames.size()) std::swap(swapped[at], swapped[at + 1]);
        EXPECT_FALSE(gives(lost, message)) << at;
        ASSERT_TRUE(gives(frames, message));  // if the last one was lost, the beginning of this one ends it
        EXPECT_EQ(receiver_.take_lost(), 1u) << at;
        const bool harmless = at + 1 == frames.size();  // the last one twice: the message was complete before
        for (const Bytes& frame : doubled) (void)take(frame);
        EXPECT_EQ(receiver_.take_lost(), harmless ? 0u : 1u) << at;
        if (harmless) continue;
        EXPECT_FALSE(gives(swapped, message)) << at;
        EXPECT_EQ(receiver_.take_lost(), 1u) << at;
    }
}

TEST_F(IsoTpTest, AFrameThatComesTooLateBelongsToNothing) {
    const Bytes message = message_of(20);
    const auto frames = frames_of(message);
    (void)take(frames[0]);
    EXPECT_EQ(take(frames[1], IsoTp::kPatience_ns), Found::nothing);
    EXPECT_EQ(take(frames[2], IsoTp::kPatience_ns + 1), Found::nothing);
    EXPECT_EQ(receiver_.take_lost(), 1u);
    EXPECT_TRUE(gives(frames, message));
}

TEST_F(IsoTpTest, AMessageThatHasNoRoomIsReportedSoAndLost) {
    ASSERT_EQ(take({0x12, 0x01, 1, 2, 3, 4, 5, 6}), Found::first);  // 513 bytes
    EXPECT_EQ(receiver_.answer()[0], 0x32);
    EXPECT_EQ(receiver_.take_lost(), 1u);
    EXPECT_EQ(take({0x21, 1, 2, 3, 4, 5, 6, 7}), Found::nothing);
}

TEST_F(IsoTpTest, WhatIsNoFrameOfTheProtocolIsSaid) {
    for (const Bytes& bad : {Bytes{}, Bytes{0x00, 1}, Bytes{0x05, 1, 2, 3, 4}, Bytes{0x0F, 1, 2, 3, 4, 5, 6, 7},
                             Bytes{0x10, 6, 1, 2, 3, 4, 5, 6}, Bytes{0x10, 20, 1, 2}, Bytes{0x40, 1}, Bytes{0xF0}})
        EXPECT_EQ(take(bad), Found::bad);
    Bytes fd(12, 0);
    fd[1] = 11;
    EXPECT_EQ(take(fd), Found::bad);
    EXPECT_EQ(receiver_.take_lost(), 0u);
}

TEST_F(IsoTpTest, FramesOfAMessageWhoseBeginningNobodySawAreNobodysLoss) {
    const auto frames = frames_of(message_of(100));
    for (std::size_t at = 5; at < frames.size(); ++at) EXPECT_EQ(take(frames[at]), Found::nothing);
    EXPECT_EQ(receiver_.take_lost(), 0u);
}

TEST_F(IsoTpTest, WhatIsForSomebodyElseOrHasNothingInItIsNoMessage) {
    EXPECT_EQ(take({0x30, 0, 0}), Found::nothing);  // flow control, for a node that talks to the device
    Bytes fd(12, 0x55);
    fd[0] = 0x05;  // a single frame of more than 8 bytes has its length in the second byte, and 0 here
    fd[1] = 10;
    EXPECT_EQ(take(fd), Found::bad);
    fd[0] = 0;
    EXPECT_EQ(take(fd), Found::message);
    const Bytes message = message_of(30);
    auto frames = frames_of(message);
    for (const std::size_t left : {std::size_t(1), std::size_t(5)}) {  // nothing, or less than fits, in the second frame
        auto cut = frames;
        cut[1].resize(left);
        EXPECT_FALSE(gives(cut, message)) << left;
        EXPECT_TRUE(gives(frames, message)) << left;
    }
}

}  // namespace
}  // namespace tactiled
