// The standard deviation of a zero over hours, and what free rests show.
#include "node/zero_error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "sensor_fixture.hpp"

namespace tactiled {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000, kHourNs = 3600 * kSecondNs;
constexpr double kSd_N = 0.1;
constexpr Wrench kSd{kSd_N, kSd_N, kSd_N, kNaN, kNaN, kNaN};

ZeroError::Rates rates(double sd_per_h) {
    ZeroError::Rates rates;
    rates.per_s = {sd_per_h / 3600, sd_per_h / 3600, sd_per_h / 3600, 0, 0, 0};
    rates.limit = {1, 1, 1, 1, 1, 1};
    return rates;
}

Wrench fz(double fz_N) { return {0, 0, fz_N, kNaN, kNaN, kNaN}; }

double sd_of(ZeroError& error, std::int64_t t_ns, bool shifted = false) {
    error.follow(t_ns, shifted);
    Wrench sd{};
    (void)error.widen(sd);
    return sd[2];
}

TEST(ZeroError, GrowsWithTheTimeSinceTheTare) {
    ZeroError error(rates(0.2));
    error.know(kHourNs);
    EXPECT_EQ(sd_of(error, kHourNs), 0);
    EXPECT_NEAR(sd_of(error, 2 * kHourNs), 0.2, 1e-12);
    EXPECT_NEAR(sd_of(error, 4 * kHourNs), 0.6, 1e-12);
    error.know(5 * kHourNs);
    EXPECT_EQ(sd_of(error, 5 * kHourNs), 0);
    error.know(2 * kHourNs);  // a tare of another run
    EXPECT_NEAR(sd_of(error, 5 * kHourNs), 0.6, 1e-12);
}

TEST(ZeroError, IsOldBeyondItsLimit) {
    ZeroError error(rates(0.2));
    Wrench sd{};
    error.follow(0, false);
    error.follow(4 * kHourNs, false);
    EXPECT_FALSE(error.widen(sd));
    error.follow(6 * kHourNs, false);
    EXPECT_TRUE(error.widen(sd));
}

// After four hours the drift has a standard deviation of 0.8 N, and a light load one of 0.1 N: 0.64 / 0.65 of a rest is
// drift.
TEST(ZeroError, ARestBoundsItByTheForceThatItMayHide) {
    ZeroError error(rates(0.2));
    error.follow(0, false);
    error.follow(4 * kHourNs, false);
    error.rest(fz(0.065), kSd, 4 * kHourNs);
    EXPECT_NEAR(error.moved_S()[2], 0.064, 1e-12);
    EXPECT_NEAR(sd_of(error, 4 * kHourNs), std::sqrt(0.01 * 0.64 / 0.65 + 0.064 * 0.064 / 9), 1e-12);
    error.rest(fz(0.001), kSd, 4 * kHourNs);
    EXPECT_NEAR(error.moved_S()[2], 0.064, 1e-12) << "the same rest again shows no more";
}

TEST(ZeroError, ARestSoonAfterATareShowsLittle) {
    ZeroError error(rates(0.2));
    error.follow(0, false);
    error.rest(fz(0.05), kSd, kHourNs / 4);
    EXPECT_NEAR(error.moved_S()[2], 0.01, 1e-12);
    EXPECT_LT(sd_of(error, kHourNs / 4), 0.05);
}

TEST(ZeroError, ARestUnderALoadShowsNothing) {
    ZeroError error(rates(0.2));
    error.follow(0, false);
    error.follow(4 * kHourNs, false);
    error.rest(fz(0.11), kSd, 4 * kHourNs);
    error.rest({0.11, 0, 0, kNaN, kNaN, kNaN}, kSd, 4 * kHourNs);           // all components are judged together
    error.rest(fz(0.01), {0.1, 0.1, kNaN, kNaN, kNaN, kNaN}, 4 * kHourNs);  // without a standard deviation
    EXPECT_EQ(error.moved_S()[2], 0);
    EXPECT_NEAR(sd_of(error, 4 * kHourNs), 0.8, 1e-12);
}

// Nothing tells a light load from a drift that is faster than stated.
TEST(ZeroError, ARestUnderALoadMayBeADriftThatGoesOn) {
    ZeroError error(rates(0));
    error.follow(0, false);
    for (std::int64_t t_ns = kSecondNs; t_ns < kHourNs; t_ns += kSecondNs) {
        const double drifted_N = 5 * double(t_ns) / double(kHourNs);
        const bool rests = t_ns < kHourNs / 4 || t_ns > kHourNs / 2;  // then it seems to be a contact
        if (rests) error.rest(fz(drifted_N), kSd, t_ns);
        ASSERT_LT(drifted_N, 3.01 * std::hypot(sd_of(error, t_ns), kSd_N)) << double(t_ns) / double(kHourNs);
    }
    error.rest(fz(0.01), kSd, kHourNs);
    EXPECT_LT(sd_of(error, kHourNs), 1e-9) << "it was a load";
    error.rest(fz(1.01), kSd, kHourNs);
    EXPECT_LT(sd_of(error, kHourNs), 1e-9) << "and so is one beyond the limit";
    error.rest(fz(0.3), kSd, kHourNs);
    error.know(kHourNs + 1);
    EXPECT_EQ(sd_of(error, kHourNs + 1), 0);
}

// Each restart may hide a step that is too small to be seen; they may all go the same way.
TEST(ZeroError, StepsOfRestartsAddUpUntilARestOrATare) {
    const Wrench tolerance{0.12, 0.12, 0.12, kNaN, kNaN, kNaN};
    ZeroError error(rates(0.2));
    error.follow(0, false);
    for (int i = 0; i < 15; ++i) error.step(tolerance);
    EXPECT_NEAR(sd_of(error, 0), 15 * 0.12 / 3, 1e-12);
    EXPECT_NEAR(error.stepped()[2], 15 * 0.12, 1e-12) << "for the next run";
    ZeroError rested = error;
    rested.rest(fz(0.02), kSd, kSecondNs);
    EXPECT_LT(sd_of(rested, kSecondNs), 1.1 * kSd_N);
    EXPECT_GT(rested.moved_S()[2], 0.95 * 0.02) << "most of it is the zero";
    error.tare(0);
    EXPECT_EQ(sd_of(error, 0), 0);
    error.step(tolerance);
    error.untare(0);
    EXPECT_NEAR(sd_of(error, 0), 16 * 0.12 / 3, 1e-12) << "the zero of the calibration has made those before the tare";
}

TEST(ZeroError, AShiftStaysUntilTheNextTareWhateverRests) {
    ZeroError::Rates stated = rates(0.2);
    stated.shift = {0.5, 0.5, 0.5, 0, 0, 0};
    ZeroError error(stated);
    EXPECT_NEAR(sd_of(error, 0, true), 0.5, 1e-12);
    error.rest(fz(0), kSd, kHourNs);
    EXPECT_NEAR(sd_of(error, kHourNs, true), std::hypot(0.5, 0.2), 1e-12);
    error.know(2 * kHourNs);
    EXPECT_EQ(sd_of(error, 2 * kHourNs), 0);
}

// Somebody adds a little each ten minutes. It is taken for drift, but never claimed to be known better than that.
TEST(ZeroError, ALoadThatGrowsSlowlyIsNeverFarBeyondItsStandardDeviation) {
    for (const double step_N : {0.02, 0.05, 0.09, 0.2}) {
        ZeroError error(rates(0.2));
        double load_N = 0, worst = 0;
        for (std::int64_t t_ns = 0; t_ns < 10 * kHourNs; t_ns += kSecondNs) {
            if (t_ns % (600 * kSecondNs) == 0) load_N += step_N;
            const double sd = std::hypot(sd_of(error, t_ns), kSd_N);
            error.rest(fz(load_N - error.moved_S()[2]), kSd, t_ns);
            worst = std::max(worst, std::abs(error.moved_S()[2]) / sd);
        }
        EXPECT_LT(worst, 3.01) << step_N;
    }
}

// With rests each minute the zero follows a drift for eight hours; without them the standard deviation does.
TEST(ZeroError, OfADriftIsTrue) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0, 1);
    for (const bool rests : {true, false}) {
        int beyond = 0, samples = 0, old = 0;
        for (int sensor = 0; sensor < 40; ++sensor) {
            ZeroError error(rates(0.2));
            const double drift_N_per_h = 0.2 * normal(random);
            for (std::int64_t t_ns = 0; t_ns < 8 * kHourNs; t_ns += 10 * kSecondNs) {
                error.follow(t_ns, false);
                Wrench sd = kSd;
                old += error.widen(sd) ? 1 : 0;
                const double true_N = drift_N_per_h * double(t_ns) / double(kHourNs);
                beyond += std::abs(true_N - error.moved_S()[2]) > 2 * sd[2] ? 1 : 0;
                ++samples;
                if (rests && t_ns % (60 * kSecondNs) == 0) error.rest(fz(true_N - error.moved_S()[2]), kSd, t_ns);
            }
        }
        EXPECT_LT(double(beyond) / samples, 0.1) << rests;
        EXPECT_EQ(double(old) / samples < 0.05, rests) << double(old) / samples << ": the limit of 1 N is five hours away";
    }
}

// ---- in a sensor -------------------------------------------------------------------------------------------------------

// A sensor whose zero drifts by up to its standard deviation in a minute.
class Drifting {
public:
    explicit Drifting(double limit_N = 1) : sensor_(made(limit_N)) {}
    static Sensor made(double limit_N) {
        Sensor::Setup setup;
        setup.channel_of_frame = {0, 1, 2};
        setup.frame_channels = 3;
        setup.zero = rates(60 * Through::kSd_N);
        setup.zero.limit = {limit_N, limit_N, limit_N, 1, 1, 1};
        setup.decoupler = std::make_unique<Through>(100, Through::kSd_N);
        Sensor sensor(std::move(setup));
        sensor.start(7, 0);
        return sensor;
    }
    tactiled_sample send(double fz_N, double seconds) {
        tactiled_sample s{};
        for (int i = 0; i < int(100 * seconds); ++i) {
            t_ns_ += 10 * kMs;
            s = sensor_.sample(frame(t_ns_, 0, 0, fz_N), t_ns_);
        }
        return s;
    }
    void interrupt() {
        t_ns_ += 200 * kMs;
        ASSERT_TRUE(sensor_.has_discontinuity(true, t_ns_));
        (void)sensor_.marker(t_ns_);
    }
    Sensor& sensor() { return sensor_; }
    std::uint64_t now() const { return t_ns_; }

private:
    Sensor sensor_;
    std::uint64_t t_ns_ = kMs;
};

TEST(SensorRest, ASecondWithoutContactMovesTheZero) {
    Drifting drifting;
    const double small_N = Through::kSd_N / 2;
    EXPECT_GT(drifting.send(small_N, 10).force_S_N[2], 0.95 * small_N) << "too early for a drift";
    EXPECT_LT(drifting.send(small_N, 900).force_S_N[2], 0.01 * small_N);
    EXPECT_EQ(drifting.sensor().last().raw_force_S_N[2], small_N);
}

TEST(SensorRest, AHeldObjectIsNoRest) {
    Drifting drifting;
    const double small_N = Through::kSd_N / 2;
    drifting.sensor().may_hold(true);
    const tactiled_sample s = drifting.send(small_N, 200);
    EXPECT_NEAR(s.force_S_N[2], small_N, 1e-12);
    EXPECT_GT(s.sd_force_N[2], 3 * Through::kSd_N) << "but time passes";
}

TEST(SensorRest, AContactOrAMotionIsNoRest) {
    Drifting drifting;
    (void)drifting.send(0, 0.1);
    EXPECT_NEAR(drifting.send(-5, 200).force_S_N[2], -5, 1e-12);
    EXPECT_GT(drifting.sensor().last().sd_force_N[2], 3 * Through::kSd_N);
}

TEST(SensorRest, AZeroThatIsOldIsUncertainUntilATareAndMayBeTared) {
    Drifting drifting(5 * Through::kSd_N);
    EXPECT_EQ(drifting.send(-5, 100).quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(drifting.send(-5, 400).reasons, unsigned(TACTILED_ZERO_OLD));
    drifting.sensor().begin_tare(drifting.now());
    EXPECT_EQ(drifting.send(-5, 1).quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(drifting.sensor().last().force_S_N[2], 0);
}

TEST(SensorRest, ZerosOfRemovedTaresAreAsOldAsTheSensor) {
    Drifting drifting;
    (void)drifting.send(-5, 100);
    drifting.sensor().begin_tare(drifting.now());
    (void)drifting.send(-5, 1);
    EXPECT_LT(drifting.sensor().last().sd_force_N[2], 1.1 * Through::kSd_N);
    drifting.sensor().begin_untare();
    EXPECT_GT(drifting.send(-5, 2).sd_force_N[2], 1.5 * Through::kSd_N);
}

TEST(SensorRest, OfAnInterruptedStreamIsNone) {
    Drifting drifting;
    const double small_N = Through::kSd_N / 2;
    for (int i = 0; i < 100; ++i) {
        (void)drifting.send(small_N, 0.8);
        drifting.interrupt();
    }
    EXPECT_NEAR(drifting.send(small_N, 0.1).force_S_N[2], small_N, 1e-12);
}

class Mounted {
public:
    Mounted() : sensor_(made()) { (void)send(-1); }
    static Sensor made() {
        Sensor::Setup setup;
        setup.channel_of_frame = {0, 1, 2};
        setup.frame_channels = 3;
        setup.needs_tare = true;
        setup.zero.shift = {0.3, 0.3, 0.3, 0, 0, 0};
        setup.decoupler = std::make_unique<Through>(100, Through::kSd_N);
        Sensor sensor(std::move(setup));
        sensor.start(7, 0);
        return sensor;
    }
    tactiled_sample send(double fz_N) {
        t_ns_ += kMs;
        Frame f = frame(t_ns_, 0, 0, fz_N);
        f.has_sequence = true;
        f.sequence = number_++;
        return sensor_.sample(f, t_ns_);
    }
    void restart() { number_ = 0; }

private:
    Sensor sensor_;
    std::uint64_t t_ns_ = 0;
    std::uint32_t number_ = 60'000;
};

TEST(SensorRest, AShiftThatTheCalibrationKnowsIsInTheStandardDeviation) {
    Mounted mounted;
    const tactiled_sample s = mounted.send(-1);
    EXPECT_EQ(s.reasons, 0u);
    EXPECT_NEAR(s.sd_force_N[2], std::hypot(0.3, Through::kSd_N), 1e-9);
}

// The sessions of the calibration do not show what zero a device takes for itself.
TEST(SensorRest, ADeviceThatStartsAgainMayShiftFurther) {
    Mounted mounted;
    for (int i = 0; i < 2000; ++i) (void)mounted.send(-5);
    mounted.restart();
    for (int i = 0; i < 5; ++i) (void)mounted.send(0);
    EXPECT_NE(mounted.send(0).reasons & TACTILED_ZERO_UNKNOWN, 0u);
}

}  // namespace
}  // namespace tactiled
