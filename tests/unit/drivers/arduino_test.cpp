// The sketch of the page of text lines, compiled from the page: the decoder reads its output.
#include <cstdarg>
#include <cstdio>
#include <random>

#include "drivers/wire/ascii_line.hpp"
#include "tests/unit/drivers/wire_bytes.hpp"

namespace tactiled {
namespace {

// The part of Arduino's library that the sketch uses.
namespace arduino {

unsigned long now_us = 4'000'000'000;
unsigned long micros() { return now_us += 4; }
constexpr int A0 = 14, A1 = 15, A2 = 16;
int analogRead(int pin) { return pin * 60 + int(now_us / 10'000 % 100); }
struct {
    unsigned long baud = 0;
    std::string printed, heard;
    void begin(unsigned long rate) { baud = rate; }
    void println(const char* text) { printed += std::string(text) + "\r\n"; }
    int read() {
        const int byte = heard.empty() ? -1 : heard[0];
        heard.erase(0, 1);
        return byte;
    }
} Serial;

#include "arduino_sketch.inc"

}  // namespace arduino

TEST(Arduino, TheSketchOfThePagePrintsWhatTheDecoderReads) {
    arduino::setup();
    EXPECT_EQ(arduino::Serial.baud, 115200u);
    for (int i = 0; i < 100; ++i) arduino::loop();
    LinkCounts counts;
    AsciiDecoder decoder({.channels = 3, .sequence = true, .time_us = true, .crc16 = true}, counts);
    const auto frames = decode(decoder, bytes_of(arduino::Serial.printed));
    ASSERT_EQ(frames.size(), 100u) << counts[TACTILED_LINK_BAD_CHECKSUM] << arduino::Serial.printed;
    for (std::size_t i = 1; i < frames.size(); ++i) {
        EXPECT_EQ(frames[i].sequence, i);
        EXPECT_NEAR(double(frames[i].device_time_us - frames[i - 1].device_time_us), 10'000, 10);
        EXPECT_NEAR(frames[i].channel[1], 900 + double(frames[i].device_time_us / 10'000 % 100), 1);
    }
    EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], 0u);
}

TEST(Arduino, TheSketchAnswersARequestBeforeItMeasuresTheNextFrame) {
    arduino::setup();
    arduino::loop();
    arduino::Serial.printed.clear();
    arduino::Serial.heard = "?17\n";
    const std::uint32_t asked_us = std::uint32_t(arduino::now_us);
    arduino::loop();
    LinkCounts counts;
    AsciiDecoder decoder({.channels = 3, .sequence = true, .time_us = true, .crc16 = true}, counts);
    const auto frames = decode(decoder, bytes_of(arduino::Serial.printed));
    ASSERT_EQ(frames.size(), 1u) << arduino::Serial.printed;
    const auto echo = decoder.take_echo();
    EXPECT_EQ(echo.number, 17u);
    EXPECT_LT(echo.time_us - asked_us, 100u) << "it answers while it waits";
    EXPECT_LT(echo.time_us, frames[0].device_time_us);
    EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], 0u);
    arduino::Serial.heard = "?\n?99\n?4294967295\n";  // bytes that wait do not delay the frames
    arduino::Serial.printed.clear();
    arduino::loop();
    EXPECT_EQ(decode(decoder, bytes_of(arduino::Serial.printed)).size(), 1u);
    EXPECT_EQ(decoder.take_echo().number, 4294967295u);
}

TEST(Arduino, TheSketchHasAtMost30Lines) {
    std::ifstream file(TACTILED_SOURCE_DIR "/drivers/wire/ascii_line.md");
    std::string line;
    int lines = 0;
    while (std::getline(file, line) && line != "```cpp") {}
    while (std::getline(file, line) && line != "```") ++lines;
    EXPECT_GT(lines, 10);
    EXPECT_LE(lines, 30);
}

// With XOR one damaged line in 14 passes; a CRC-16 misses one in 65536.
TEST(AsciiLine, ACrcFindsLostBytesThatAnExclusiveOrMisses) {
    const auto passed = [](bool crc16, unsigned lost) {
        const AsciiFormat format{.channels = 3, .checksum = true, .sequence = true, .crc16 = crc16};
        std::mt19937 random(lost);
        unsigned wrong = 0;
        for (unsigned n = 0; n < 20'000; ++n) {
            const Frame frame =
                frame_of(n + 1000, {int(random() % 200'000) - 100'000.0, int(random() % 200'000) / 8.0, 5.5});
            std::array<char, kAsciiMaxBytes * 2> out;
            std::string line(out.data(), encode_ascii(frame, format, out));
            for (unsigned k = 0; k < lost; ++k) line.erase(random() % (line.size() - 1), 1);
            LinkCounts counts;
            AsciiDecoder decoder(format, counts);
            for (const Frame& read : decode(decoder, bytes_of("\n" + line)))
                wrong += read.sequence != frame.sequence ||
                         !std::equal(read.channel.begin(), read.channel.begin() + 3, frame.channel.begin());
        }
        return wrong;
    };
    for (unsigned lost = 1; lost <= 16; ++lost) EXPECT_LE(passed(true, lost), 3u) << lost << " bytes";
    EXPECT_GT(passed(false, 2), 100u) << "the exclusive or is as weak as its page says";
}

TEST(AsciiLine, WantsTheChecksumThatIsConfigured) {
    const auto accepts = [](const AsciiFormat& format, const std::string& line) {
        LinkCounts counts;
        AsciiDecoder decoder(format, counts);
        return decode(decoder, bytes_of("\n" + line + "\n")).size() == 1;
    };
    const AsciiFormat none{.channels = 1}, by_xor{.channels = 1, .checksum = true},
        crc{.channels = 1, .checksum = true, .crc16 = true};
    std::array<char, kAsciiMaxBytes * 2> out;
    const auto line = [&](const AsciiFormat& format) {
        std::string text(out.data(), encode_ascii(frame_of(0, {12.5}), format, out));
        text.pop_back();
        return text;
    };
    EXPECT_EQ(line(crc).size(), 9u);
    for (const AsciiFormat& format : {none, by_xor, crc})
        for (const AsciiFormat& sent : {none, by_xor, crc}) {
            const bool same = format.checksum == sent.checksum && format.crc16 == sent.crc16;
            EXPECT_EQ(accepts(format, line(sent)), same || !format.checksum) << line(sent);
        }
    for (const AsciiFormat& sent : {by_xor, crc}) {
        std::string damaged = line(sent);
        damaged[0] = '2';
        EXPECT_FALSE(accepts(none, damaged));
    }
}

}  // namespace
}  // namespace tactiled
