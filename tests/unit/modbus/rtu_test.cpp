// One serial line on a pty, on a clock of the test's own.
#include "node/modbus/rtu.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#include <vector>

namespace tactiled::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes framed(Bytes bytes) {
    const std::uint16_t crc = rtu_crc(bytes);
    bytes.insert(bytes.end(), {std::uint8_t(crc & 0xFF), std::uint8_t(crc >> 8)});
    return bytes;
}

TEST(Rtu, AFrameHasAFunction) {
    std::array<std::uint8_t, kMostAdu> out;
    EXPECT_EQ(adu_of_rtu(framed({1}), out), 0u);  // an address and a right checksum
    EXPECT_EQ(adu_of_rtu(framed({1, 7}), out), 8u);
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
            [this](auto adu, auto out) {
                ++asked_;
                std::copy(adu.begin(), adu.end(), out.begin());
                return adu.size();
            },
            now_ns_);
    }
    // The bytes of one piece arrive now.
    void say(const Bytes& bytes) {
        ASSERT_EQ(::write(master_, bytes.data(), bytes.size()), ssize_t(bytes.size()));
        pollfd p{line_->fd(), POLLIN, 0};
        for (std::size_t left = bytes.size(); left > 0 && ::poll(&p, 1, 1000) == 1; left = 0) {
            ::usleep(2000);  // a pty hands its bytes over in a kernel thread of its own
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
    say(write);  // heard at once: our own answer
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

}  // namespace
}  // namespace tactiled::modbus
