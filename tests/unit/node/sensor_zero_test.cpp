// The zero of a device that has gone on, started again or been exchanged.
#include <gtest/gtest.h>

#include "sensor_fixture.hpp"

namespace tactiled {
namespace {

constexpr unsigned kUnknown = TACTILED_ZERO_UNKNOWN | TACTILED_UNKNOWN_UNCERTAINTY;

// A tared sensor at 1 kHz that reads -15 N, of which -10 N are its zero. `counts`: its frames have a number.
class Watched {
public:
    explicit Watched(bool counts, bool doubts = true) : sensor_(made(doubts)), counts_(counts) {
        (void)send(-10, 50);
        sensor_.begin_tare(t_ns_);
        (void)send(-10, 150);
        EXPECT_EQ(sensor_.poll_tare(t_ns_), Tare::done);
        (void)send(-15, 1500);
    }
    static Sensor made(bool doubts) {
        Sensor::Setup setup;
        setup.channel_of_frame = {0, 1, 2};
        setup.frame_channels = 3;
        setup.tuning.doubts_zero = doubts;
        setup.decoupler = std::make_unique<Through>(100, Through::kSd_N);
        Sensor sensor(std::move(setup));
        sensor.start(7, 0);
        return sensor;
    }
    // The last of `n` samples of this force.
    tactiled_sample send(double fz_N, int n = 5) {
        tactiled_sample s{};
        for (int i = 0; i < n; ++i) {
            Frame f = frame(t_ns_ += kMs, 0, 0, fz_N);
            f.has_sequence = counts_;
            f.sequence = number_++;
            s = sensor_.sample(f, t_ns_);
        }
        return s;
    }
    void wait(std::uint64_t ms, bool goes_on = true) {
        t_ns_ += ms * kMs;
        number_ = goes_on ? number_ + std::uint32_t(ms) : 0;
        if (sensor_.has_discontinuity(ms < 500, t_ns_)) (void)sensor_.marker(t_ns_);
    }
    void tare() {
        sensor_.begin_tare(t_ns_);
        (void)send(0, 150);
        EXPECT_EQ(sensor_.poll_tare(t_ns_), Tare::done);
    }
    Sensor& sensor() { return sensor_; }

private:
    Sensor sensor_;
    bool counts_;
    std::uint64_t t_ns_ = 1'000 * kMs;
    std::uint32_t number_ = 60'000;
};

// It takes the load of 5 N at its start for zero.
TEST(SensorZero, ADeviceThatStartsAgainWithAnotherZeroIsDoubtedUntilATare) {
    for (const std::uint64_t ms : {0, 20, 300, 3000}) {
        Watched watched(true);
        watched.wait(ms, false);
        EXPECT_EQ(watched.send(-10).reasons, kUnknown) << ms << " ms";
        EXPECT_EQ(watched.send(-10).force_S_N[2], 0) << "its number is kept";
        watched.tare();
        EXPECT_EQ(watched.send(0).quality, unsigned(TACTILED_GOOD));
    }
}

TEST(SensorZero, ADeviceThatStartsAgainWithTheSameForceIsGoodAtOnce) {
    Watched watched(true);
    watched.wait(2000, false);
    EXPECT_EQ(watched.send(-15, 1).quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(watched.send(-11, 5).quality, unsigned(TACTILED_GOOD)) << "and may move from there";
}

TEST(SensorZero, ADeviceThatGoesOnIsGoodUnderAnyForce) {
    for (const bool counts : {true, false}) {
        Watched watched(counts);
        watched.wait(50);
        EXPECT_EQ(watched.send(-11).quality, unsigned(TACTILED_GOOD)) << "a blink";
    }
}

// Its counter goes on, but the sensor at its amplifier may be another one.
TEST(SensorZero, AfterALongTimeWithoutAChannelTheSensorMayBeAnotherOne) {
    for (const int ms : {900, 1200}) {
        Watched watched(true);
        (void)watched.send(kNaN, ms);
        EXPECT_EQ(watched.send(-11).reasons, ms < 1000 ? 0 : kUnknown) << ms;
    }
}

TEST(SensorZero, AReloadKeepsWhatMayHaveHappened) {
    Watched watched(true);
    Sensor fresh = Watched::made(true);
    watched.wait(300, false);
    (void)watched.send(-11, 1);  // not confirmed
    fresh.succeed(watched.sensor());
    EXPECT_TRUE(fresh.doubts_zero());
}

// The device starts again while the sensor is exchanged.
TEST(SensorZero, AReloadKeepsTheNumberOfTheDevice) {
    Watched watched(true);
    Sensor fresh = Watched::made(true);
    fresh.succeed(watched.sensor());
    std::swap(watched.sensor(), fresh);
    watched.wait(300, false);
    (void)watched.send(-11);
    EXPECT_TRUE(watched.sensor().doubts_zero());
}

TEST(SensorZero, AReloadKeepsTheStepsOfRestarts) {
    Watched watched(true);
    for (int i = 0; i < 20; ++i) {
        watched.wait(300, false);
        (void)watched.send(-15, 20);
    }
    Sensor fresh = Watched::made(true);
    fresh.succeed(watched.sensor());
    std::swap(watched.sensor(), fresh);
    (void)watched.send(-15);
    EXPECT_GT(watched.sensor().last_force()->stepped[2], 0.1);
}

// Each restart may have moved the zero by as much as the force may differ.
TEST(SensorZero, RestartsWithTheSameForceAgeTheZero) {
    Watched watched(true);
    const double before = watched.send(-15).sd_force_N[2];
    for (int i = 0; i < 20; ++i) {
        watched.wait(300, false);
        EXPECT_EQ(watched.send(-15 - 0.005 * i, 20).quality, unsigned(TACTILED_GOOD)) << i;
    }
    EXPECT_GT(watched.send(-15).sd_force_N[2], 5 * before);
    EXPECT_GT(watched.sensor().last_force()->stepped[2], 0.1);
    watched.tare();
    EXPECT_NEAR(watched.send(0).sd_force_N[2], before, 0.01 * before);
}

TEST(SensorZero, AnotherDeviceIsDoubted) {
    Watched plain(false);
    plain.wait(3000);
    EXPECT_EQ(plain.send(-12).reasons, kUnknown);
    EXPECT_EQ(plain.send(-15).reasons, kUnknown) << "a force that is the one before by chance proves nothing later";
    plain.sensor().begin_untare();
    EXPECT_EQ(plain.send(-12).quality, unsigned(TACTILED_GOOD)) << "the user knows that the calibration's zero is right";
}

TEST(SensorZero, AGlitchAtTheStartIsNoOtherZero) {
    Watched watched(true);
    watched.wait(300, false);
    EXPECT_EQ(watched.send(-90, 1).reasons & TACTILED_STEPPED, unsigned(TACTILED_STEPPED));
    EXPECT_EQ(watched.send(-15).quality, unsigned(TACTILED_GOOD));
}

// At rest the noise of 0 shows that the sd of 10 mN is no noise.
TEST(SensorZero, TheSameForceIsTheSameWithinOneSdAndTheNoise) {
    Watched same(true), other(true);
    same.wait(300, false);
    EXPECT_EQ(same.send(-15 + 0.9 * Through::kSd_N).quality, unsigned(TACTILED_GOOD));
    other.wait(300, false);
    EXPECT_EQ(other.send(-15 + 1.5 * Through::kSd_N).reasons, kUnknown);
}

// The force moves by 2 sd in each sample until the device starts again.
TEST(SensorZero, AMotionMayGoOnOrEndInARestart) {
    constexpr double kStep_N = 2 * Through::kSd_N;
    for (const double steps : {-1.0, 0.0, 0.5, 1.0, 2.0}) {
        Watched watched(true);
        double fz_N = -15;
        for (int i = 0; i < 100; ++i) (void)watched.send(fz_N += kStep_N, 1);
        watched.wait(20, false);
        const unsigned expected = steps >= 0 && steps <= 1 ? 0 : kUnknown;
        EXPECT_EQ(watched.send(fz_N + steps * kStep_N).reasons, expected) << steps << " steps";
    }
}

TEST(SensorZero, TheLastForceOfARunIsTheLastConfirmedOne) {
    Watched watched(true);
    ASSERT_TRUE(watched.sensor().last_force());
    EXPECT_EQ(watched.sensor().last_force()->raw_S[2], -15);
    (void)watched.send(-90, 1);
    watched.wait(3000, false);
    EXPECT_EQ(watched.sensor().last_force()->raw_S[2], -15) << "a glitch, then a silence";
    (void)watched.send(-10);
    EXPECT_FALSE(watched.sensor().last_force()) << "it is doubted";
}

TEST(SensorZero, WithKeepNothingIsDoubted) {
    Watched watched(true, false);
    watched.wait(3000, false);
    EXPECT_EQ(watched.send(-10).quality, unsigned(TACTILED_GOOD));
}

}  // namespace
}  // namespace tactiled
