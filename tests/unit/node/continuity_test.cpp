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
    void start_again() {
        number_ = 0;
        clock_us_ = 0;
    }
    void reopen() { ++opening_; }
    bool goes_on_after(double s, bool counts = true) {
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
        return check_.goes_on(frame, t_ns_, kRate_Hz, kStart);
    }
    bool was_set_up = false;

private:
    Continuity check_;
    bool has_number_, has_clock_;
    unsigned bits_;
    std::uint32_t number_, opening_ = 1;
    std::uint64_t t_ns_ = kSecond, clock_us_ = 7;
};

TEST(Continuity, ANumberOrAClockThatBeginsAnewIsNotTheOneBefore) {
    for (const bool has_clock : {false, true}) {
        Device device(!has_clock, has_clock);
        for (const double s : {0.01, 0.05, 0.9}) EXPECT_TRUE(device.goes_on_after(s)) << s;
        EXPECT_TRUE(device.goes_on_after(0.9, false)) << "it sends on change";
        device.start_again();
        EXPECT_FALSE(device.goes_on_after(0.3)) << has_clock;
        EXPECT_TRUE(device.goes_on_after(0.01));
    }
}

TEST(Continuity, ALongSilenceEndsItWhateverGoesOn) {
    for (const bool has_number : {false, true})
        for (const bool has_clock : {false, true}) {
            Device device(has_number, has_clock);
            EXPECT_FALSE(device.goes_on_after(1.1)) << "its sensor may have been exchanged";
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
        for (const double gap_s : {0.3, 0.6, 0.9}) {
            int passed = 0;
            for (int i = 0; i < 1000; ++i) {
                Device device(true, false, bits, std::uint32_t(random()));
                device.start_again();
                passed += device.goes_on_after(gap_s);
            }
            EXPECT_LE(passed, 10) << bits << " bits, " << gap_s << " s";
        }
}

// A recording does not have the width.
TEST(Continuity, TheWidthOfACounterIsLearned) {
    Device device(true, false, 16, 65'400);
    for (int i = 0; i < 300; ++i) EXPECT_TRUE(device.goes_on_after(0.01)) << i;
}

TEST(Continuity, ACounterThatMeetsTheOldOneHasAnotherClock) {
    Device device(true, true, 16);
    for (int i = 0; i < 20; ++i) EXPECT_TRUE(device.goes_on_after(0.9));
    device.start_again();
    EXPECT_FALSE(device.goes_on_after(0.3));
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
