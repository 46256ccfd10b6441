// A device goes on between two frames, or may have started again.
#include "node/continuity.hpp"

#include <gtest/gtest.h>

#include <random>
#include <utility>

namespace tactiled {
namespace {

constexpr std::uint64_t kSecond = 1'000'000'000, kStart = kSecond;
constexpr double kRate_Hz = 100;

// A device whose number and clock are those of its last start.
class Device {
public:
    Device(bool has_number, bool has_clock, unsigned bits = 32, std::uint32_t first = 65'300)
        : has_number_(has_number), has_clock_(has_clock), bits_(bits), number_(first) {
        for (int i = 0; i < 200; ++i) (void)goes_on_after(0.01);
    }
    // A device with a number that has sent so few frames that its rate is not measured.
    explicit Device(int frames) : has_number_(true), has_clock_(false), bits_(32), number_(65'300), rate_Hz_(kNaN) {
        for (int i = 0; i < frames; ++i) (void)goes_on_after(0.01);
    }
    void start_again() {
        number_ = 0;
        clock_us_ = 0;
    }
    void reopen() { ++opening_; }
    bool goes_on_after(double s, bool counts = true, bool has_all = true) {
        t_ns_ += std::uint64_t(s * 1e9);
        clock_us_ += std::uint64_t(s * 1e6);
        number_ += counts ? std::uint32_t(s * kRate_Hz + 0.5) : 1;
        Frame frame;
        frame.has_sequence = has_number_;
        frame.sequence_bits = std::uint8_t(bits_);
        frame.sequence = number_ & (bits_ >= 32 ? ~0u : (1u << bits_) - 1);
        frame.device_time_us = has_clock_ ? clock_us_ : 0;
        frame.opening = opening_;
        frame.restarted = std::exchange(was_set_up, false);
        return check_.goes_on(frame, has_all, t_ns_, rate_Hz_, kStart);
    }
    [[nodiscard]] bool has_proof() const { return check_.has_proof(); }
    bool was_set_up = false;

private:
    Continuity check_;
    bool has_number_, has_clock_;
    unsigned bits_;
    std::uint32_t number_, opening_ = 1;
    std::uint64_t t_ns_ = kSecond, clock_us_ = 7;
    double rate_Hz_ = kRate_Hz;
};

TEST(Continuity, ALongNumberOrAClockThatGoesOnProvesItOverAGap) {
    for (const bool has_clock : {false, true}) {
        Device device(!has_clock, has_clock);
        for (const double s : {0.01, 0.05, 3.0, 60.0}) EXPECT_TRUE(device.goes_on_after(s)) << s;
        EXPECT_TRUE(device.goes_on_after(30, false)) << "it sends on change";
        device.start_again();
        EXPECT_FALSE(device.goes_on_after(0.3)) << has_clock;
        EXPECT_FALSE(device.has_proof());
        EXPECT_TRUE(device.goes_on_after(0.01));
        EXPECT_TRUE(device.has_proof());
    }
}

TEST(Continuity, AShortCounterProvesNothingOverALongGap) {
    Device device(true, false, 16), byte(true, false, 8);
    EXPECT_TRUE(device.goes_on_after(0.9)) << "a blink";
    EXPECT_FALSE(device.goes_on_after(60));
    EXPECT_FALSE(byte.goes_on_after(1.5));
    EXPECT_TRUE(byte.goes_on_after(0.5));
}

// The sensor is pulled from its amplifier, which goes on.
TEST(Continuity, AChannelThatWasMissingForLongMayBeOfAnotherSensor) {
    for (const double missing_s : {0.9, 1.2}) {
        Device device(true, true);
        for (double s = 0; s < missing_s; s += 0.01) EXPECT_TRUE(device.goes_on_after(0.01, true, false));
        EXPECT_EQ(device.goes_on_after(0.01), missing_s < 1);
        EXPECT_TRUE(device.goes_on_after(0.01));
    }
}

TEST(Continuity, ALinkThatWasLostNeedsANumberOrAClockThatGoesOn) {
    for (const unsigned bits : {0u, 8u, 16u, 32u})
        for (const bool has_clock : {false, true}) {
            Device device(bits != 0, has_clock, bits);
            device.reopen();
            EXPECT_EQ(device.goes_on_after(0.05), bits > 8 || has_clock) << bits;
            EXPECT_TRUE(device.goes_on_after(0.01));
        }
}

TEST(Continuity, AnyNumberIsUnlikelyToBeThatOfAnotherCount) {
    std::mt19937 random(7);
    for (const unsigned bits : {16u, 32u})
        for (const double gap_s : {1.2, 3.0, 60.0}) {
            int passed = 0;
            for (int i = 0; i < 1000; ++i) {
                Device device(true, false, bits, std::uint32_t(random()));
                device.start_again();
                passed += device.goes_on_after(gap_s);
            }
            EXPECT_LE(passed, 1000 / 16 + 20) << bits << " bits, " << gap_s << " s";
        }
}

// A recording does not have the width.
TEST(Continuity, ANumberIsJudgedFromSixteenFramesOn) {
    Device device(16), other(16);
    EXPECT_TRUE(device.goes_on_after(0.3));
    EXPECT_TRUE(device.has_proof());
    other.start_again();
    EXPECT_FALSE(other.goes_on_after(0.3));
}

TEST(Continuity, TheWidthOfACounterIsLearned) {
    Device device(true, false, 16, 65'400);
    for (int i = 0; i < 300; ++i) EXPECT_TRUE(device.goes_on_after(0.01)) << i;
}

// A bridge may count on while its front end starts again.
TEST(Continuity, ACounterThatMeetsTheOldOneHasAnotherClock) {
    for (const double uptime_s : {20.0, 1200.0, 3000.0, 4200.0}) {
        Device other(true, true, 16);
        EXPECT_TRUE(other.goes_on_after(uptime_s));
        other.start_again();
        EXPECT_FALSE(other.goes_on_after(0.3)) << uptime_s;
        EXPECT_FALSE(other.has_proof());
    }
}

TEST(Continuity, WithoutEitherAGapThatIsLongEnoughForAStartEndsIt) {
    Device device(false, false);
    EXPECT_TRUE(device.goes_on_after(0.05));
    EXPECT_TRUE(device.goes_on_after(0.9));
    EXPECT_FALSE(device.goes_on_after(1.1));
    EXPECT_TRUE(device.goes_on_after(0.01));
    device.was_set_up = true;
    EXPECT_FALSE(device.goes_on_after(0.01)) << "a chip that has lost its settings";
    EXPECT_TRUE(device.goes_on_after(0.01));
}

}  // namespace
}  // namespace tactiled
