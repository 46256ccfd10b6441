// A device with less noise than in its calibration.
#include "node/quiet_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/milliseconds.hpp"

namespace tactiled {
namespace {

constexpr double kNoise = 8;  // counts

class Device {
public:
    explicit Device(std::uint64_t period_ns, std::uint64_t calibrated_ns) : period_ns_(period_ns) {
        const double sd = kNoise / 4;
        tuning_.least_noise_of[0] = tuning_.least_noise_of[1] = 2 * sd * sd;  // the third channel is not known
        tuning_.noise_interval_ns = calibrated_ns;
    }
    // Sends rounded noise of these sd around a load that moves by `speed` in a second. Returns the share that is too quiet.
    double send(double sd_0, double sd_1, double seconds, double speed = 0, std::uint32_t usable = 0b111) {
        std::normal_distribution<double> normal;
        const int n = int(seconds * 1e9 / double(period_ns_));
        int quiet = 0;
        for (int i = 0; i < n; ++i) {
            t_ns_ += period_ns_;
            load_ += speed * double(period_ns_) * 1e-9;
            raw_ = {std::round(load_ + sd_0 * normal(random_)), std::round(load_ + sd_1 * normal(random_)), 7};
            quiet += check_.judge(raw_, usable, t_ns_, tuning_) ? 1 : 0;
        }
        return double(quiet) / n;
    }
    // Sends the last numbers again. Returns the share that is too quiet.
    double repeat(double seconds) {
        const int n = int(seconds * 1e9 / double(period_ns_));
        int quiet = 0;
        for (int i = 0; i < n; ++i) quiet += check_.judge(raw_, 0b111, t_ns_ += period_ns_, tuning_) ? 1 : 0;
        return double(quiet) / n;
    }
    void accept() { tuning_.noise_interval_ns = 0; }

private:
    std::uint64_t period_ns_, t_ns_ = 77 * kMs;
    double load_ = 1000;
    std::array<double, 3> raw_{};
    Tuning tuning_;
    QuietCheck check_;
    std::mt19937_64 random_{1};
};

TEST(QuietCheck, TheNoiseOfTheCalibrationIsNeverTooQuiet) {
    for (const std::uint64_t period_ms : {1, 10, 18}) {
        Device device(period_ms * kMs, 10 * kMs);
        EXPECT_EQ(device.send(kNoise, kNoise, 3000), 0) << period_ms;
        EXPECT_EQ(device.send(kNoise / 2, kNoise / 2, 3000), 0) << period_ms << ", half of it";
        EXPECT_EQ(device.send(10 * kNoise, 10 * kNoise, 300, 50), 0) << period_ms << ", vibration";
    }
}

TEST(QuietCheck, ARangeOfFewerBitsIsFoundWithinASecondAndNoTouchEndsIt) {
    Device device(10 * kMs, 10 * kMs);
    EXPECT_EQ(device.send(kNoise, kNoise, 10), 0);
    EXPECT_GT(device.send(kNoise / 16, kNoise / 16, 2), 0);  // the first window has both noises
    EXPECT_EQ(device.send(kNoise / 16, kNoise / 16, 1), 1);
    EXPECT_EQ(device.send(kNoise, kNoise, 20, 1000), 1);
    device.accept();
    EXPECT_EQ(device.send(kNoise / 16, kNoise / 16, 10), 0);
}

TEST(QuietCheck, EachChannelMustBeQuiet) {
    Device device(10 * kMs, 10 * kMs);
    EXPECT_EQ(device.send(kNoise / 16, kNoise, 30), 0);
    EXPECT_EQ(device.send(kNoise / 16, kNoise / 16, 30, 0, 0b101), 0) << "one is saturated";
    EXPECT_GT(device.send(0, kNoise / 16, 30), 0.9) << "one may repeat its number";
}

// A gateway stalls for a second or two, at any time, and is read faster than it measures.
TEST(QuietCheck, NumbersThatAllRepeatAreTooQuietUntilTheyChange) {
    for (const std::uint64_t period_ms : {2, 10}) {
        Device device(period_ms * kMs, 10 * kMs);
        std::mt19937 random(3);
        for (int stall = 0; stall < 200; ++stall) {
            (void)device.send(kNoise, kNoise, 0.05);
            EXPECT_EQ(device.send(kNoise, kNoise, 1 + double(random() % 100) / 100), 0) << stall;
            EXPECT_GT(device.repeat(1.2 + double(random() % 100) / 100), 0.2);
        }
    }
    for (const std::uint64_t updated_ms : {20, 100, 200}) {
        Device device(10 * kMs, 10 * kMs);
        for (int i = 0; i < 2000; ++i) {
            EXPECT_EQ(device.send(kNoise, kNoise, 0.011), 0) << updated_ms;
            EXPECT_EQ(device.repeat(double(updated_ms - 10) * 1e-3), 0) << updated_ms;
        }
    }
}

// The difference of 50 Hz hum is large in 10 ms and none in 20 ms.
TEST(QuietCheck, ADeviceThatIsReadSlowerThanInTheCalibrationIsNotJudged) {
    Device device(25 * kMs, 10 * kMs);
    EXPECT_EQ(device.send(kNoise / 16, kNoise / 16, 30), 0);
}

// Noise that a low pass of the device has smoothed: neighbours are alike.
TEST(QuietCheck, ADeviceThatIsReadFasterThanInTheCalibrationIsNotQuieter) {
    Tuning tuning;
    const double sd = kNoise / 4;
    tuning.least_noise_of[0] = 2 * sd * sd;
    tuning.noise_interval_ns = 50 * kMs;
    QuietCheck check;
    std::mt19937_64 random(2);
    std::normal_distribution<double> normal;
    double smooth = 0;
    for (std::uint64_t i = 1; i < 300'000; ++i) {
        smooth += 0.05 * (kNoise * std::sqrt(39) * normal(random) - smooth);  // sd kNoise, 20 ms
        EXPECT_FALSE(check.judge(std::span(&smooth, 1), 1, i * kMs, tuning));
    }
}

}  // namespace
}  // namespace tactiled
