// Converts registers to numbers, and tests the configuration of registers.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "drivers/driver.hpp"
#include "drivers/modbus_device.hpp"

namespace tactiled {
namespace {

struct Read {
    ModbusDevice device;
    std::string problems;
};

Read read(const std::string& text, const std::string& file = "test.toml") {
    Problems problems;
    Options options = Options::parse_text(text, file, problems);
    Read read{read_modbus_device(options, ModbusWire::rtu), ""};
    options.finish();
    for (const auto& line : problems.lines()) read.problems += line + "\n";
    return read;
}

TEST(RegisterSet, ReadsEveryTypeInBothWordOrders) {
    const std::string types = R"([{name = "a", at = 10, type = "int16", scale = 0.5}, {name = "b", at = 11, type = "uint16"},
        {name = "c", at = 12, type = "int32"}, {name = "d", at = 14, type = "uint32"}, {name = "e", at = 16, type = "float32"}])";
    const std::uint16_t high_first[] = {0xFFFE, 0xFFFE, 0xFFFF, 0xFFFE, 0xFFFF, 0xFFFE, 0xC0A0, 0x0000};
    const std::uint16_t low_first[] = {0xFFFE, 0xFFFE, 0xFFFE, 0xFFFF, 0xFFFE, 0xFFFF, 0x0000, 0xC0A0};
    for (const bool low : {false, true}) {
        const auto one =
            read(std::string("word_order = ") + (low ? "\"low_first\"" : "\"high_first\"") + "\nregisters = " + types);
        ASSERT_EQ(one.problems, "");
        EXPECT_EQ(one.device.set.at, 10);
        EXPECT_EQ(one.device.set.count, 8);
        SequenceTracker sequence;
        LinkCounts counts;
        Frame frame;
        ASSERT_TRUE(read_registers(one.device.set, low ? low_first : high_first, sequence, counts, frame));
        ASSERT_EQ(frame.n_channels, 5);
        EXPECT_EQ(frame.channel[0], -1);
        EXPECT_EQ(frame.channel[1], 65534);
        EXPECT_EQ(frame.channel[2], -2);
        EXPECT_EQ(frame.channel[3], 4294967294.0);
        EXPECT_EQ(frame.channel[4], -5);
    }
}

TEST(RegisterSet, NoNumberIsAMissingChannelAndAnInfiniteOneNoFrame) {
    const auto one = read(R"(registers = [{name = "a", at = 0, type = "float32"}, {name = "b", at = 2, type = "float32"}])");
    SequenceTracker sequence;
    LinkCounts counts;
    Frame frame;
    const std::uint16_t nan[] = {0x7FC0, 0, 0x3F80, 0}, infinite[] = {0x3F80, 0, 0x7F80, 0};
    ASSERT_TRUE(read_registers(one.device.set, nan, sequence, counts, frame));
    EXPECT_EQ(frame.missing, 1u);
    EXPECT_TRUE(std::isnan(frame.channel[0]));
    EXPECT_EQ(frame.channel[1], 1);
    EXPECT_FALSE(read_registers(one.device.set, infinite, sequence, counts, frame));
    EXPECT_EQ(counts[TACTILED_LINK_BAD_VALUE], 1u);
}

TEST(RegisterSet, TheEndsOfAnIntegerAreSaturationLimitsAndTheRestOfItIsNot) {
    const auto one = read(R"(registers = [{name = "a", at = 0}, {name = "b", at = 1}, {name = "c", at = 2, type = "uint16"},
        {name = "d", at = 3, type = "int32"}, {name = "e", at = 5, type = "uint32"}, {name = "f", at = 7, type = "float32"}])");
    ASSERT_EQ(one.problems, "");
    SequenceTracker sequence;
    LinkCounts counts;
    Frame frame;
    const auto saturated = [&](const std::array<std::uint16_t, 9>& words) {
        EXPECT_TRUE(read_registers(one.device.set, words, sequence, counts, frame));
        return frame.saturated;
    };
    EXPECT_EQ(saturated({0x7FFF, 0x8000, 0xFFFF, 0x7FFF, 0xFFFF, 0xFFFF, 0xFFFF, 0x7F7F, 0xFFFF}), 0b11111u);
    EXPECT_EQ(saturated({0x7FFE, 0x8001, 0xFFFE, 0x8000, 0x0000, 0xFFFF, 0xFFFE, 0, 0}), 0b01000u);
    EXPECT_EQ(saturated({0, 0xFFFF, 0, 0x7FFF, 0xFFFE, 0, 0, 0, 0}), 0u);  // 0 is the reading of an unsigned one at rest
}

TEST(RegisterSet, GivesNoFrameUnlessTheDeviceSaysReady) {
    const auto one = read(R"(registers = [{name = "a", at = 1}]
        ready = [{at = 0, mask = 0x00F0, value = 0x0020}])");
    ASSERT_EQ(one.problems, "");
    SequenceTracker sequence;
    LinkCounts counts;
    Frame frame;
    const std::uint16_t ready[] = {0xAB2F, 5}, busy[] = {0xAB3F, 5};
    EXPECT_TRUE(read_registers(one.device.set, ready, sequence, counts, frame));
    EXPECT_FALSE(read_registers(one.device.set, busy, sequence, counts, frame));
    EXPECT_EQ(counts[TACTILED_LINK_BAD_VALUE], 1u);
}

TEST(RegisterSet, AFrozenCounterGivesNoSecondFrameAndAGapIsLost) {
    const auto one = read(R"(registers = [{name = "a", at = 1}]
        sequence = {at = 0, type = "uint16"})");
    ASSERT_EQ(one.problems, "");
    SequenceTracker sequence;
    LinkCounts counts;
    Frame frame;
    const auto next = [&](std::uint16_t n) {
        const std::uint16_t words[] = {n, 5};
        return read_registers(one.device.set, words, sequence, counts, frame);
    };
    EXPECT_TRUE(next(65534));
    for (int i = 0; i < 5; ++i) EXPECT_FALSE(next(65534));
    EXPECT_EQ(counts[TACTILED_LINK_REPEATED], 5u);
    EXPECT_TRUE(next(1));  // across the wrap
    EXPECT_EQ(frame.lost, 2u);
    EXPECT_EQ(counts[TACTILED_LINK_LOST], 2u);
}

TEST(RegisterSet, ASlaveThatAnswersWithTwoCountersAlternatelyHasNoChannels) {
    const auto one = read(R"(registers = [{name = "a", at = 1}]
        sequence = {at = 0, type = "uint16"})");
    SequenceTracker sequence;
    LinkCounts counts;
    Frame frame;
    int of_the_second = 0;
    for (std::uint16_t n = 0; n < 300; ++n)
        for (const bool second : {false, true}) {
            const std::uint16_t words[] = {std::uint16_t(second ? n + 5000 : n), std::uint16_t(second ? 2 : 1)};
            if (!read_registers(one.device.set, words, sequence, counts, frame) || frame.n_channels == 0) continue;
            of_the_second += second ? 1 : 0;
        }
    EXPECT_LE(of_the_second, 19);
    EXPECT_EQ(frame.n_channels, 0);
}

TEST(ModbusDevice, TellsWhatIsWrongAndWhatWouldBeRight) {
    const auto wrong = [](const std::string& text, const std::string& expected) {
        const std::string problems = read(text).problems;
        EXPECT_NE(problems.find(expected), std::string::npos) << problems;
    };
    wrong("", "registers is missing");
    wrong(R"(registers = [{name = "a", at = 70000}])", "test.toml:1: registers \"a\": at = 70000 is outside 0 .. 65535");
    wrong(R"(registers = [{name = "a", at = 1, type = "int8"}])", "type = \"int8\" is unknown");
    wrong(R"(registers = [{name = "a", at = 1}, {name = "a", at = 2}])", "registers has \"a\" twice");
    wrong(R"(registers = [{name = "a", at = 1, scale = 0}])", "scale = 0");
    wrong(
        R"(registers = [{name = "a", at = 1}, {name = "b", at = 30}])",
        "between registers 1 and 30 lie 28 that are not used, more than max_gap = 8; a frame is one answer: give each group "
        "its own [[link.slave]], or set max_gap = 28 where");
    wrong(R"(registers = [{name = "a", at = 0}, {name = "b", at = 200}])", "give each group its own [[link.slave]]");
    EXPECT_EQ(read(R"(registers = [{name = "a", at = 0}, {name = "b", at = 200}])").problems.find("set max_gap"),
              std::string::npos);  // its range ends at 124
    wrong("max_gap = 124\nregisters = [{name = \"a\", at = 0}, {name = \"b\", at = 125}]", "one answer has at most 125");
    wrong(R"(registers = [{name = "a", at = 65535, type = "int32"}])", "up to 65535");
    wrong("registers = [{name = \"a\", at = 1}]\nready = [{at = 1, mask = 1, value = 2}]", "could never be ready");
    wrong("registers = [{name = \"a\", at = 1}]\nstart = [{at = 1, value = 2, function = 10}]", "6 and 16 write registers");
    wrong("registers = [{name = \"a\", at = 1}]\nunit = 248", "unit = 248 is outside 1 .. 247");
    wrong("registers = [{name = \"a\", at = 1}]\nrate_hz = 5", "unknown key \"rate_hz\"; did you mean \"rate_Hz\"?");
    wrong("registers_file = \"no/such.toml\"", "no/such.toml");
}

TEST(ModbusDevice, EveryFileOfConfigDevicesIsReadAndMayBeOverridden) {
    const std::string config = std::string(TACTILED_SOURCE_DIR) + "/config/test.toml";
    const auto of = [&](const std::string& name) { return "registers_file = \"devices/" + name + ".toml\"\n"; };
    const auto ft300 = read(of("robotiq_ft300") + "device = 3\nrate_Hz = 20", config);
    EXPECT_EQ(ft300.problems, "");
    EXPECT_EQ(ft300.device.unit, 9);
    EXPECT_EQ(ft300.device.rate_Hz, 20);
    EXPECT_EQ(ft300.device.device, 3);
    EXPECT_EQ(ft300.device.set.at, 180);
    EXPECT_EQ(ft300.device.set.count, 6);
    const auto hex = read(of("onrobot_hex") + "unit = 66", config);
    EXPECT_EQ(hex.problems, "");
    EXPECT_EQ(hex.device.unit, 66);
    EXPECT_EQ(hex.device.set.at, 257);
    EXPECT_EQ(hex.device.set.count, 8);
    const auto rg2ft = read(of("onrobot_rg2ft"), config);
    EXPECT_EQ(rg2ft.problems, "");
    EXPECT_EQ(rg2ft.device.set.channel.size(), 12u);
    EXPECT_EQ(rg2ft.device.set.count, 17);
    const auto both = read(of("robotiq_ft300") + "registers = [{name = \"a\", at = 1}]", config);
    EXPECT_NE(both.problems.find("unknown table [[registers]]"), std::string::npos) << both.problems;
}

}  // namespace
}  // namespace tactiled
