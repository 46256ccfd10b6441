// A recording read from the disk: the same messages as from its bytes, with work and memory that do not depend on its
// length.
#include "drivers/mcap/message_file.hpp"

#include <gtest/gtest.h>

#include <sys/stat.h>

#include <cstring>
#include <random>

#include "drivers/mcap/format.hpp"
#include "tests/unit/drivers/recording.hpp"

namespace tactiled::mcap {
namespace {

constexpr int kMessages = 60, kMessagesOfChunk = 7;

struct Seen {
    std::vector<std::string> messages;
    std::string why;
    bool operator==(const Seen&) const = default;
};

template <class Source>
Seen all_of(Source& source) {
    Seen seen;
    while (const auto message = source.next())
        seen.messages.push_back(message->channel->topic + std::string(message->data.data(), message->data.size()));
    seen.why = source.why();
    return seen;
}

struct MessageFileTest : testing::Test {
    MessageFileTest() {
        recording.writer.attach("tactiled.toml", "application/toml", std::string(3000, 'x'), 5);
        for (int i = 0; i < kMessages; ++i) {
            recording.frame(std::uint16_t(i % 2), std::uint64_t(i), i);
            if (i % kMessagesOfChunk == kMessagesOfChunk - 1) recording.writer.flush();
        }
        recording.writer.close();
        bytes = recording.bytes();
    }
    Seen from_disk() {
        EXPECT_EQ(file.open(recording.path), "");
        return all_of(file);
    }
    static Seen from(const std::string& bytes) {
        Reader reader(bytes);
        return all_of(reader);
    }
    Recording recording{{"usb0", "usb1"}};
    std::string bytes;
    MessageFile file;
};

TEST_F(MessageFileTest, GivesTheMessagesOfTheBytesCutAnywhereOrWhole) {
    ASSERT_EQ(from(bytes).messages.size(), std::size_t(kMessages));
    for (std::size_t size = 0; size <= bytes.size(); size += size + 31 < bytes.size() ? 31 : 1) {
        recording.become(bytes.substr(0, size));
        ASSERT_EQ(from_disk(), from(bytes.substr(0, size))) << size;
    }
}

TEST_F(MessageFileTest, OfADamagedFileItGivesWhatIsThere) {
    std::mt19937_64 random(3);
    for (int i = 0; i < 500; ++i) {
        std::string damaged = bytes;
        damaged[random() % damaged.size()] ^= char(1u << random() % 8);
        recording.become(damaged);
        ASSERT_EQ(from_disk().messages, from(damaged).messages) << i;
    }
}

TEST_F(MessageFileTest, ARecordLongerThanTheFileOrThanAnyNumberIsItsEnd) {
    for (const std::uint64_t size : {std::uint64_t(bytes.size()), UINT64_MAX - 8, UINT64_MAX}) {
        std::string head(1, char(Op::chunk));
        head.append(reinterpret_cast<const char*>(&size), sizeof size);
        recording.become(bytes.substr(0, kMagic.size()) + head + bytes.substr(kMagic.size()));
        EXPECT_EQ(from_disk().messages.size(), 0u);
        EXPECT_LT(file.bytes_read(), 2 * bytes.size());
    }
}

TEST_F(MessageFileTest, AFileThatIsShortenedWhileItIsReadJustEnds) {
    ASSERT_EQ(file.open(recording.path), "");
    ASSERT_TRUE(file.next().has_value());
    ASSERT_EQ(::truncate(recording.path.c_str(), off_t(bytes.size() / 2)), 0);
    const std::size_t seen = 1 + all_of(file).messages.size();
    EXPECT_GT(seen, 10u);
    EXPECT_LT(seen, std::size_t(kMessages));
    EXPECT_TRUE(file.at_end());
}

TEST_F(MessageFileTest, OpeningAFileOfManyGigabytesReadsOneChunkOfIt) {
    // An attachment that is a hole in the file, then the end of the recording.
    constexpr std::uint64_t kHole = 64ull << 30;
    std::string head(1, char(Op::attachment));
    head.append(reinterpret_cast<const char*>(&kHole), sizeof kHole);
    const std::size_t end_at = bytes.rfind(std::string("\x0f\x04\0\0\0\0\0\0\0", 9));
    recording.become(bytes.substr(0, end_at) + head);
    ASSERT_EQ(::truncate(recording.path.c_str(), off_t(end_at + head.size() + kHole)), 0);
    ASSERT_EQ(file.open(recording.path), "");
    ASSERT_TRUE(file.next().has_value());
    file.declare_all();
    EXPECT_LT(file.bytes_read(), 2 * MessageFile::kMaxPiece);
    EXPECT_LE(file.memory_bytes(), MessageFile::kMaxRecord + 64);
    for (int i = 1; i < kMessages; ++i) ASSERT_TRUE(file.next().has_value());
    const std::uint64_t before = file.bytes_read();
    EXPECT_FALSE(file.next(1u << 20).has_value());
    EXPECT_FALSE(file.at_end());
    EXPECT_LE(file.bytes_read() - before, (1u << 20) + MessageFile::kMaxPiece);
}

TEST_F(MessageFileTest, AChunkTooLongForTheMemoryIsLeftOutAndSaid) {
    const std::uint64_t too_long = MessageFile::kMaxRecord;
    std::string chunk(1, char(Op::chunk));
    chunk.append(reinterpret_cast<const char*>(&too_long), sizeof too_long);
    std::size_t at = kMagic.size();  // of the first chunk
    for (std::uint64_t size = 0; Op(bytes[at]) != Op::chunk; at += kRecordHead + size)
        std::memcpy(&size, &bytes[at + 1], sizeof size);
    recording.become(bytes.substr(0, at) + chunk + std::string(too_long, 0) + bytes.substr(at));
    const Seen seen = from_disk();
    EXPECT_EQ(seen.messages, from(bytes).messages);
    EXPECT_EQ(seen.why, "1 chunks of more than 10 MiB left out");
}

TEST_F(MessageFileTest, AfterDeclareAllNoChannelIsNew) {
    ASSERT_EQ(file.open(recording.path), "");
    file.declare_all();  // before any record: from the summary only
    EXPECT_EQ(file.reader().channels().size(), 2u);
    EXPECT_EQ(all_of(file).messages, from(bytes).messages);
    recording.become(bytes.substr(0, bytes.size() - 1));  // the summary cannot be found
    ASSERT_EQ(file.open(recording.path), "");
    file.declare_all();
    EXPECT_EQ(all_of(file).messages.size(), 0u);
    EXPECT_EQ(file.reader().unreadable(), unsigned(kMessages));
}

TEST_F(MessageFileTest, WhatIsNoRecordingSaysSo) {
    EXPECT_NE(file.open("/nowhere/x.mcap").find("No such file"), std::string::npos);
    EXPECT_NE(file.open("/dev/null").find("is no file"), std::string::npos);
    EXPECT_FALSE(file.next().has_value());
    recording.become("no MCAP at all");
    EXPECT_EQ(from_disk().why, "is no MCAP file");
    recording.become("");
    EXPECT_EQ(from_disk().why, "is no MCAP file");
}

}  // namespace
}  // namespace tactiled::mcap
