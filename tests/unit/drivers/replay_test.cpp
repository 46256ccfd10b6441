// Driver "replay": a recorded link, with its frames in their order and at their intervals.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "drivers/driver.hpp"
#include "drivers/mcap/message_file.hpp"
#include "tests/unit/drivers/recording.hpp"

namespace tactiled {
namespace {

struct Replay : testing::Test {
    std::unique_ptr<Driver> make(const std::string& keys) {
        Problems problems;
        Options options =
            Options::parse_text(fmt::format("file = \"{}\"\nspeed = 1000\n{}", recording.path, keys), "test.toml", problems);
        auto driver = Drivers::find("replay")->make(options);
        options.finish();
        EXPECT_TRUE(problems.empty());
        return driver;
    }
    // Returns the numbers of the frames until the recording ends, and the number of calls without a frame.
    std::vector<double> play(Driver& driver) {
        std::vector<double> numbers;
        Frame frame;
        turns = 0;
        for (;;) {
            const Status status = driver.read(frame, 1000);
            if (status == Status::disconnected) return numbers;
            if (status == Status::timeout) ++turns;
            if (status == Status::frame) numbers.push_back(frame.channel[0]);
        }
    }
    // Adds frames of the other link, some MiB of them.
    void others(unsigned MiB) {
        const std::uint64_t until = recording.writer.bytes() + (std::uint64_t(MiB) << 20);
        while (recording.writer.bytes() < until) recording.frame(1, 5, 0);
    }
    mcap::Recording recording{{"usb0", "usb1"}};
    int turns = 0;
};

TEST_F(Replay, GivesTheFramesOfItsLinkAndEnds) {
    for (unsigned i = 0; i < 100; ++i) recording.frame(i % 2, 1000 + i, i);
    recording.writer.close();
    const auto driver = make("link = \"usb1\"\nat_end = \"again\"");
    for (int step = 0; step < 2; ++step) {
        ASSERT_EQ(driver->open(), "");
        const auto numbers = play(*driver);
        ASSERT_EQ(numbers.size(), 50u);
        for (unsigned i = 0; i < 50; ++i) EXPECT_EQ(numbers[i], 2 * i + 1);
        driver->close();
    }
    EXPECT_EQ(driver->counts[TACTILED_LINK_FRAMES], 100u);
    const auto once = make("link = \"usb0\"");
    ASSERT_EQ(once->open(), "");
    EXPECT_EQ(play(*once).size(), 50u);
    EXPECT_NE(once->open().find("has ended"), std::string::npos);
}

TEST_F(Replay, ACycleReadsAMebibyteWhereItsLinkIsSilent) {
    recording.frame(0, 0, 1);
    others(40);
    recording.frame(0, 7, 2);
    recording.writer.close();
    const auto driver = make("link = \"usb0\"");
    ASSERT_EQ(driver->open(), "");
    EXPECT_EQ(play(*driver), (std::vector<double>{1, 2}));
    EXPECT_GE(turns, 19);  // a call ends with the chunk in which its MiB ended
    EXPECT_LE(turns, 80);
}

TEST_F(Replay, ALinkThatIsSilentForLongAtFirstIsFoundAndBeginsThen) {
    others(40);
    recording.frame(0, 7, 1);
    recording.frame(0, 8, 2);
    recording.writer.close();
    const auto driver = make("link = \"usb0\"");
    ASSERT_EQ(driver->open(), "");  // after 16 MiB
    EXPECT_EQ(play(*driver), (std::vector<double>{1, 2}));
    EXPECT_GE(turns, 11);
}

TEST_F(Replay, ALinkWithoutAFrameIsReportedAtOpeningOrAtTheEnd) {
    recording.frame(1, 0, 1);
    recording.writer.flush();
    EXPECT_NE(make("link = \"usb0\"")->open().find("no frames of link \"usb0\"; it has usb0, usb1"), std::string::npos);
    EXPECT_NE(make("link = \"usb7\"")->open().find("no frames of link \"usb7\""), std::string::npos);
    EXPECT_NE(make("")->open().find("has several links: link = one of usb0, usb1"), std::string::npos);
    others(20);
    recording.writer.close();
    const auto driver = make("link = \"usb0\"");
    EXPECT_EQ(driver->open(), "");
    EXPECT_EQ(play(*driver).size(), 0u);
}

TEST_F(Replay, ADamagedChunkIsLeftOutAndCounted) {
    for (unsigned i = 0; i < 30; ++i) {
        recording.frame(0, i, i);
        if (i % 10 == 9) recording.writer.flush();
    }
    recording.writer.close();
    std::string bytes = recording.bytes();
    const double fifteen = 15;
    bytes[bytes.find(std::string(reinterpret_cast<const char*>(&fifteen), sizeof fifteen))] ^= 1;
    recording.become(bytes);
    const auto driver = make("link = \"usb0\"");
    ASSERT_EQ(driver->open(), "");
    const auto numbers = play(*driver);
    ASSERT_EQ(numbers.size(), 20u);
    EXPECT_EQ(numbers[10], 20);
    EXPECT_EQ(driver->counts[TACTILED_LINK_BAD_CHECKSUM], 1u);
}

}  // namespace
}  // namespace tactiled
