// One serial line on a pty, on a clock controlled by the test.
#include "node/modbus/rtu.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "drivers/wire/modbus_message.hpp"

namespace tactiled::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes framed(Bytes bytes) {
    const std::uint16_t crc = modbus_crc(bytes);
    bytes.insert(bytes.end(), {std::uint8_t(crc & 0xFF), std::uint8_t(crc >> 8)});
    return bytes;
}

TEST(Rtu, AFrameHasAFunction) {
    EXPECT_FALSE(is_rtu_frame(framed({1})));  // an address and a correct checksum
    EXPECT_TRUE(is_rtu_frame(framed({1, 7})));
    EXPECT_TRUE(is_rtu_frame(framed(Bytes(kMaxRtu - 2))));
    EXPECT_FALSE(is_rtu_frame(framed(Bytes(kMaxRtu - 1))));
}

TEST(Rtu, AnAnswerIsReportedFromAnotherRequestOfItsLength) {
    struct Case {
        const char* what;
        Bytes request, other;
        bool is_answer;
    };
    const Case cases[] = {
        {"a read", {1, 3, 0, 0, 0, 2}, {1, 3, 4, 0x54, 0x41, 0x43, 0x54}, true},
        {"of another unit", {1, 3, 0, 0, 0, 2}, {2, 3, 4, 0x54, 0x41, 0x43, 0x54}, false},
        {"of another function", {1, 3, 0, 0, 0, 2}, {1, 4, 4, 0x54, 0x41, 0x43, 0x54}, false},
        {"of another length", {1, 3, 0, 0, 0, 2}, {1, 3, 2, 0x54, 0x41, 0x43, 0x54}, false},
        {"the same request", {1, 3, 0, 0, 0, 2}, {1, 3, 0, 0, 0, 2}, false},
        {"20 coils, as long as a request", {1, 1, 0, 0, 0, 20}, {1, 1, 3, 0, 0, 0}, true},
        {"the request for 20 coils", {1, 1, 0, 0, 0, 20}, {1, 1, 0, 0, 0, 20}, false},
        {"an exception", {1, 3, 0, 99, 0, 1}, {1, 0x83, 2}, true},
        {"an exception of another function", {1, 3, 0, 99, 0, 1}, {1, 0x84, 2}, false},
        {"function 0x83, refused", {1, 0x83, 0, 0, 0, 1}, {1, 0x83, 1}, true},
        {"a written register", {1, 6, 0x13, 0xEC, 0, 7}, {1, 6, 0x13, 0xEC, 0, 7}, true},
        {"another value", {1, 6, 0x13, 0xEC, 0, 7}, {1, 6, 0x13, 0xEC, 0, 8}, false},
        {"a mask write", {1, 22, 0x13, 0xEC, 0, 1, 0, 2}, {1, 22, 0x13, 0xEC, 0, 1, 0, 2}, true},
        {"another mask", {1, 22, 0x13, 0xEC, 0, 1, 0, 2}, {1, 22, 0x13, 0xEC, 0, 1, 0, 3}, false},
        {"written registers", {1, 16, 0x13, 0xEC, 0, 1, 2, 0, 7}, {1, 16, 0x13, 0xEC, 0, 1}, true},
        {"written at another address", {1, 16, 0x13, 0xEC, 0, 1, 2, 0, 7}, {1, 16, 0x13, 0xED, 0, 1}, false},
        {"written coils", {1, 15, 0, 0, 0, 8, 1, 7}, {1, 15, 0, 0, 0, 8}, true},
        {"read and write", {1, 23, 0, 0, 0, 1, 0x13, 0xEC, 0, 1, 2, 0, 7}, {1, 23, 2, 0x54, 0x41}, true},
        {"read of 6 and write, its answer",
         {1, 23, 0, 0, 0, 6, 0x13, 0xEC, 0, 1, 2, 0, 7},
         {1, 23, 12, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12},
         true},
        {"read at 0x0C1C and write of 2, as long as that answer",
         {1, 23, 0, 0, 0, 6, 0x13, 0xEC, 0, 1, 2, 0, 7},
         {1, 23, 0x0C, 0x1C, 0, 6, 0x13, 0xEC, 0, 2, 4, 0, 7, 0, 8},
         false},
        {"query data", {1, 8, 0, 0, 1, 2}, {1, 8, 0, 0, 1, 2}, true},
        {"other query data", {1, 8, 0, 0, 1, 2}, {1, 8, 0, 0, 1, 3}, false},
        {"the server id", {1, 17}, {1, 17, 3, 84, 255, 65}, true},
        {"the identity", {1, 43, 14, 4, 0}, {1, 43, 14, 4, 0x82, 0, 0, 1, 0, 1, 65}, true},
        {"another part of the identity", {1, 43, 14, 4, 0}, {1, 43, 14, 1, 0x82, 0, 0, 1, 0, 1, 65}, false},
    };
    for (const Case& c : cases) EXPECT_EQ(is_answer_to(framed(c.request), framed(c.other)), c.is_answer) << c.what;
}

class RtuTest : public testing::Test {
protected:
    RtuTest() {
        char name[64];
        termios raw{};
        ::cfmakeraw(&raw);
        EXPECT_EQ(::openpty(&master_, &slave_, name, &raw, nullptr), 0);
        settings_.device = name;
        settings_.baud = 19200;
        settings_.parity = "even";
        settings_.address = 1;
    }
    ~RtuTest() override {
        ::close(master_);
        ::close(slave_);
    }
    void open() {
        line_ = std::make_unique<RtuLine>(settings_);
        tick();
        ASSERT_GE(line_->fd(), 0);
    }
    void tick() {
        line_->tick(
            [this](auto frame) {
                ++asked_;
                return line_->responder.send(frame, line_->responder.pdu_of(frame));
            },
            now_ns_);
    }
    // The bytes of one piece arrive now.
    void say(const Bytes& bytes) {
        ASSERT_EQ(::write(master_, bytes.data(), bytes.size()), ssize_t(bytes.size()));
        pollfd p{line_->fd(), POLLIN, 0};
        for (std::size_t left = bytes.size(); left > 0 && ::poll(&p, 1, 1000) == 1; left = 0) {
            ::usleep(2000);  // a pty passes its bytes on in a kernel thread
            ASSERT_TRUE(line_->receive(now_ns_));
        }
    }
    void be_silent(std::uint64_t ns = 3'000'000) {
        now_ns_ += ns;
        tick();
    }
    int master_ = -1, slave_ = -1;
    RtuSettings settings_{};
    std::unique_ptr<RtuLine> line_;
    std::uint64_t now_ns_ = 1'000'000'000;
    int asked_ = 0;
};

TEST_F(RtuTest, ARepeatedRequestIsNoEcho) {
    open();
    const Bytes write = framed({1, 6, 0x13, 0xEC, 0, 7});  // its answer is the same frame
    say(write);
    be_silent();
    EXPECT_EQ(asked_, 1);
    say(write);  // received at once: an echo of the answer
    be_silent();
    EXPECT_EQ(asked_, 1);
    say(write);  // once only
    be_silent();
    EXPECT_EQ(asked_, 2);
    now_ns_ += 20'000'000;  // later than an echo can be: 8 characters, twice t3.5, 2 ms
    say(write);
    be_silent();
    EXPECT_EQ(asked_, 3);
    EXPECT_EQ(line_->counts().echoes, 1u);
}

TEST_F(RtuTest, AFrameThatIsTooLongSpoilsNoOther) {
    open();
    say(Bytes(300, 0));
    be_silent();
    EXPECT_EQ(line_->counts().bad_frames, 1u);
    say(framed({1, 3, 0, 0, 0, 1}));
    be_silent();
    EXPECT_EQ(asked_, 1);
}

TEST_F(RtuTest, BytesAfterASilenceBeginAFrameAlsoWhereNobodyLookedInBetween) {
    open();
    say({1, 3, 0});
    now_ns_ += 10'000'000;  // no tick(): the thread was busy
    say(framed({1, 3, 0, 0, 0, 1}));
    be_silent();
    EXPECT_EQ(asked_, 1);
}

TEST_F(RtuTest, ACharacterHasElevenBits) {
    for (const auto& [parity, two] : {std::pair("none", true), std::pair("even", false), std::pair("odd", false)}) {
        settings_.parity = parity;
        open();
        termios t{};
        ASSERT_EQ(::tcgetattr(line_->fd(), &t), 0);
        EXPECT_EQ((t.c_cflag & CSTOPB) != 0, two) << parity;
    }
}

TEST_F(RtuTest, WhatIsNotForUsIsAnsweredBySilence) {
    open();
    Bytes wrong = framed({1, 3, 0, 0, 0, 1});
    for (const std::size_t at : {wrong.size() - 2, wrong.size() - 1}) {  // each byte of the checksum
        wrong[at] ^= 1;
        say(wrong);
        be_silent();
        wrong[at] ^= 1;
    }
    say(framed({2, 3, 0, 0, 0, 1}));
    be_silent();
    EXPECT_EQ(asked_, 0);
    say(framed({0, 6, 0x13, 0xEC, 0, 7}));  // a broadcast: carried out, and not answered
    be_silent();
    EXPECT_EQ(asked_, 1);
    EXPECT_EQ(line_->counts().bad_frames, 2u);
    EXPECT_EQ(line_->counts().for_others, 1u);
    EXPECT_EQ(line_->counts().broadcasts, 1u);
    pollfd p{master_, POLLIN, 0};
    EXPECT_EQ(::poll(&p, 1, 20), 0) << "nothing was said";
}

TEST_F(RtuTest, AnotherRequestOfTheLengthOfOurAnswerIsNoEcho) {
    open();
    say(framed({1, 6, 0x13, 0xEC, 0, 7}));
    be_silent();
    say(framed({1, 6, 0x13, 0xEC, 0, 8}));
    be_silent();
    say(framed({1, 3, 0, 0}));  // nor a shorter one
    be_silent();
    EXPECT_EQ(asked_, 3);
    EXPECT_EQ(line_->counts().echoes, 0u);
}

TEST_F(RtuTest, ARequestIsAnsweredAfterThreeAndAHalfCharactersOrAsConfigured) {
    struct Case {
        int baud, silence_us;
        std::uint64_t ends_ns;
    };
    for (const auto& [baud, silence_us, ends_ns] :
         {Case{9600, 0, 4'010'416}, Case{115200, 0, 334'201}, Case{115200, 100, 100'000}, Case{115200, 3000, 3'000'000}}) {
        settings_.baud = baud;
        settings_.silence_us = silence_us;
        open();
        const int before = asked_;
        say(framed({1, 3, 0, 0, 0, 1}));
        be_silent(ends_ns - 1);
        EXPECT_EQ(asked_, before) << baud;
        be_silent(1);
        EXPECT_EQ(asked_, before + 1) << baud;
    }
}

TEST_F(RtuTest, AnUnknownFunctionAndARequestInPiecesEndAfterALongerSilence) {
    settings_.baud = 115200;
    open();
    say(framed({1, 0x42, 0, 0, 0, 1}));  // with unknown length: these may be its first bytes
    be_silent(1'749'999);
    EXPECT_EQ(asked_, 0);
    be_silent(1);
    EXPECT_EQ(asked_, 1);

    const auto request = framed({1, 16, 0x13, 0x88, 0, 2, 4, 0, 1, 0, 2});
    for (std::size_t i = 0; i < request.size(); ++i) {  // each byte separately, 1.7 ms apart
        EXPECT_EQ(asked_, 1) << i;
        say({request[i]});
        be_silent(i + 1 < request.size() ? 1'700'000 : 334'201);
    }
    EXPECT_EQ(asked_, 2);
    EXPECT_EQ(line_->counts().bad_frames, 0u);
}

TEST_F(RtuTest, BytesThatFollowARequestWithoutSilenceSpoilIt) {
    settings_.baud = 115200;
    open();
    say(framed({1, 3, 0, 0, 0, 1}));
    be_silent(300'000);
    say({7});  // less than 3.5 characters later
    be_silent(10'000'000);
    EXPECT_EQ(asked_, 0);
    EXPECT_EQ(line_->counts().bad_frames, 1u);
}

TEST(Rtu, ARequestIsOnlyAtTheLengthThatItStates) {
    const Bytes requests[] = {framed({1, 1, 0, 0, 0, 9}),
                              framed({1, 2, 0, 0, 0, 9}),
                              framed({1, 3, 0, 0, 0, 9}),
                              framed({1, 4, 0, 0, 0, 9}),
                              framed({1, 5, 0, 0, 0xFF, 0}),
                              framed({1, 6, 0, 0, 0, 9}),
                              framed({1, 15, 0, 0, 0, 9, 2, 0, 1}),
                              framed({1, 16, 0, 0, 0, 1, 2, 0, 1}),
                              framed({1, 17}),
                              framed({1, 22, 0, 0, 0, 1, 0, 2}),
                              framed({1, 43, 14, 1, 0}),
                              framed({1, 23, 0, 0, 0, 1, 0, 9, 0, 1, 2, 0, 7})};
    for (const auto& request : requests) {
        EXPECT_TRUE(is_whole_request(request)) << int(request[1]);
        for (std::size_t size = 0; size < request.size(); ++size)
            EXPECT_FALSE(is_whole_request(std::span(request).first(size))) << int(request[1]) << ' ' << size;
        Bytes longer(request.begin(), request.end() - 2);
        longer.push_back(0);
        EXPECT_FALSE(is_whole_request(framed(longer))) << int(request[1]);
    }
    EXPECT_FALSE(is_whole_request(framed({1, 8, 0, 0, 1, 2})));  // its data may have any length
}

TEST_F(RtuTest, AnAdapterThatIsPulledOutIsOpenedAgain) {
    open();
    EXPECT_TRUE(line_->receive(now_ns_));  // nothing was there to read
    ::close(master_);
    EXPECT_FALSE(line_->receive(now_ns_));
    EXPECT_EQ(line_->fd(), -1);
    tick();
    EXPECT_EQ(line_->fd(), -1);  // not at once
    const std::string disconnected = std::exchange(settings_.device, "/dev/no-such-line");
    line_ = std::make_unique<RtuLine>(settings_);
    testing::internal::CaptureStderr();
    for (int i = 0; i < 5; ++i) be_silent(1'000'000'000);
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_EQ(line_->fd(), -1);
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;  // once, not each second
    EXPECT_NE(said.find("/dev/no-such-line"), std::string::npos) << said;
    EXPECT_EQ(::openpty(&master_, &slave_, nullptr, nullptr, nullptr), 0);
}

}  // namespace
}  // namespace tactiled::modbus
