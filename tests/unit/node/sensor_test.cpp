#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "sensor_fixture.hpp"

namespace tactiled {
namespace {

TEST(Sensor, DividesCountsAndKeepsTheTimestampOfTheFrame) {
    Sensor sensor = make(100);
    const auto s = sensor.sample(frame(5 * kMs, 100, -200, 300), 6 * kMs);
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(s.force_S_N[0], 1);
    EXPECT_EQ(s.force_S_N[1], -2);
    EXPECT_EQ(s.force_S_N[2], 3);
    EXPECT_EQ(s.t_ns, 5 * kMs);
    EXPECT_TRUE(std::isnan(s.torque_S_Nm[0]));  // an unmeasured component is not zero
    EXPECT_EQ(s.epoch, 7u << 16);
}

Sensor with(const std::function<void(Sensor::Setup&)>& change) {
    Sensor::Setup setup;
    setup.channel_of_frame = {0, 1, 2};
    setup.frame_channels = 4;
    setup.decoupler = std::make_unique<Through>();
    change(setup);
    Sensor sensor(std::move(setup));
    sensor.start(7, 0);
    return sensor;
}

tactiled_sample send(Sensor& sensor, std::uint64_t t_ns, double force, double fourth) {
    Frame f = frame(t_ns, force, 0, 0);
    f.n_channels = 4;
    f.channel[3] = fourth;
    return sensor.sample(f, t_ns);
}

TEST(Sensor, TakesItsTemperatureFromAChannelOfTheFrame) {
    Sensor sensor = with([](Sensor::Setup& setup) { setup.temperature_of_frame = 3; });
    EXPECT_EQ(send(sensor, kMs, 1, 23.5).temperature_C, 23.5f);
    EXPECT_TRUE(std::isnan(send(sensor, 2 * kMs, 1, std::nan("")).temperature_C));
    Sensor none = with([](Sensor::Setup&) {});
    EXPECT_TRUE(std::isnan(send(none, kMs, 1, 23.5).temperature_C));
}

std::uint64_t slept_ns = 0;  // beyond the real time in suspension

TEST(Sensor, FramesThatWaitedWhileTheMachineWasSuspendedHaveNoValue) {
    Sensor sensor = with([](Sensor::Setup& setup) {
        setup.frame_channels = 3;
        setup.decoupler = std::make_unique<Through>(INFINITY, kNaN);  // without a check of jumps
        setup.boot_ns = []() noexcept { return with_suspend_ns() + slept_ns; };
    });
    const std::uint64_t at_ns = 10'000 * kMs;
    EXPECT_EQ(sensor.sample(frame(at_ns, 1, 0, 0), at_ns).quality, unsigned(TACTILED_GOOD));
    EXPECT_FALSE(sensor.has_discontinuity(true, at_ns + kMs));
    slept_ns = 1000 * kMs;
    const auto waited = sensor.sample(frame(at_ns + 10 * kMs, 1, 0, 0), at_ns + 11 * kMs);
    EXPECT_EQ(waited.quality, unsigned(TACTILED_BAD));
    EXPECT_NE(waited.reasons & TACTILED_STALE, 0u);
    EXPECT_EQ(sensor.sample(frame(at_ns + 12 * kMs, 1, 0, 0), at_ns + 12 * kMs).quality, unsigned(TACTILED_GOOD));
    slept_ns += 1000 * kMs;
    EXPECT_TRUE(sensor.has_discontinuity(true, at_ns + 13 * kMs)) << "no frame has come: the last value is old";
    EXPECT_NE(sensor.marker(at_ns + 13 * kMs).reasons & TACTILED_STALE, 0u);
    slept_ns = 0;
}

TEST(Sensor, ASaturatedOrJumpingThermometerHasNoValue) {
    Sensor sensor = with([](Sensor::Setup& setup) { setup.temperature_of_frame = 3; });
    EXPECT_EQ(send(sensor, kMs, 1, 23.5).temperature_C, 23.5f);
    EXPECT_TRUE(std::isnan(send(sensor, 2 * kMs, 1, 40).temperature_C));
    Frame f = frame(3 * kMs, 1, 0, 0);
    f.n_channels = 4;
    f.channel[3] = 23.5;
    f.saturated = 8;
    EXPECT_TRUE(std::isnan(sensor.sample(f, 3 * kMs).temperature_C));
    EXPECT_EQ(send(sensor, 4 * kMs, 1, 23.5).temperature_C, 23.5f);
}

TEST(Sensor, TakesTheTemperatureOfAnotherSensorWhileThatDelivers) {
    Sensor thermometer = with([](Sensor::Setup& setup) { setup.temperature_of_frame = 3; });
    Sensor sensor = with([](Sensor::Setup& setup) { setup.temperature_of_sensor = 0; });
    (void)send(thermometer, kMs, 1, 23.5);
    sensor.take_temperature(thermometer.last());
    EXPECT_EQ(send(sensor, kMs, 1, 99).temperature_C, 23.5f);
    EXPECT_TRUE(thermometer.has_discontinuity(false, 2 * kMs));
    (void)thermometer.marker(2 * kMs);
    sensor.take_temperature(thermometer.last());
    EXPECT_TRUE(std::isnan(send(sensor, 2 * kMs, 1, 99).temperature_C));
}

TEST(Sensor, AFrameOfAnotherDeviceThanTheCalibrationsHasNoValue) {
    Sensor sensor = with([](Sensor::Setup& setup) {
        setup.serial_of_frame = 3;
        setup.serial = 1017;
        setup.decoupler = std::make_unique<Through>(INFINITY, kNaN);
    });
    EXPECT_EQ(send(sensor, kMs, 1, 1017).quality, unsigned(TACTILED_GOOD));
    for (const double other : {1018.0, 0.0, -1017.0, std::nan("")}) {
        const auto s = send(sensor, 2 * kMs, 1, other);
        EXPECT_EQ(s.quality, unsigned(TACTILED_BAD)) << other;
        EXPECT_EQ(s.reasons, unsigned(TACTILED_WRONG_DEVICE)) << other;
        EXPECT_TRUE(std::isnan(s.force_S_N[0]));
    }
    EXPECT_EQ(send(sensor, 3 * kMs, 1, 1017).quality, unsigned(TACTILED_GOOD));
}

TEST(Sensor, TheDelayOfChainAndLowPassIsInTheStandardDeviationWhileTheForceMoves) {
    Sensor chain = with([](Sensor::Setup& setup) { setup.tuning.delay_s = {0.004, 0.004, 0.004}; });
    Sensor filtered = with([](Sensor::Setup& setup) { setup.tuning.filter_hz = 50; });
    tactiled_sample late{}, low_passed{};
    for (std::uint64_t i = 1; i < 50; ++i) {
        late = send(chain, i * kMs, 0.1 * double(i), 0);  // 100 N/s
        low_passed = send(filtered, i * kMs, 0.1 * double(i), 0);
    }
    EXPECT_NEAR(late.sd_force_N[0], std::hypot(Through::kSd_N, 0.4), 1e-9);
    EXPECT_EQ(late.sd_force_N[1], Through::kSd_N);
    EXPECT_EQ(late.t_ns, 49 * kMs);
    const double lag_N = low_passed.raw_force_S_N[0] - low_passed.force_S_N[0];
    EXPECT_NEAR(lag_N, 100 * 0.2048 / 50, 1e-3);
    EXPECT_NEAR(low_passed.sd_force_N[0], lag_N, 4 * Through::kSd_N);
    for (std::uint64_t i = 50; i < 60; ++i) late = send(chain, i * kMs, 5, 0);
    EXPECT_EQ(late.sd_force_N[0], Through::kSd_N);
}

TEST(Sensor, AMissingChannelIsBadAndItsForceNoNumber) {
    Sensor sensor = make();
    Frame f = frame(kMs, 1, 2, 3);
    f.missing = 2;
    auto s = sensor.sample(f, kMs);
    EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(s.reasons, unsigned(TACTILED_MISSING_CHANNEL));
    EXPECT_EQ(s.missing, 2u);
    EXPECT_TRUE(std::isnan(s.force_S_N[0]));
    EXPECT_TRUE(std::isnan(s.raw_force_S_N[0]));
    for (const double poison : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
        s = sensor.sample(frame(kMs, 1, poison, 3), kMs);
        EXPECT_EQ(s.missing, 2u);
        EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));
    }
}

TEST(Sensor, AtTheSaturationLimitCountsAsSaturated) {
    Sensor sensor = make();
    EXPECT_EQ(sensor.sample(frame(kMs, 1000, 0, -1000), kMs).saturated, 0b101u);
    EXPECT_EQ(sensor.sample(frame(kMs, 999, 0, -999), kMs).saturated, 0u);
    Frame f = frame(kMs, 1, 2, 3);
    f.saturated = 4;  // the driver knows a saturation limit
    EXPECT_EQ(sensor.sample(f, kMs).saturated, 4u);
}

TEST(Sensor, AFrameOfAnotherShapeIsAnotherDevice) {
    Sensor sensor = make();
    Frame f = frame(kMs, 1, 2, 3);
    for (const std::uint8_t channels : {std::uint8_t(2), std::uint8_t(4)}) {
        f.n_channels = channels;
        const auto s = sensor.sample(f, kMs);
        EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));
        EXPECT_EQ(s.reasons, unsigned(TACTILED_WRONG_DEVICE));
    }
}

TEST(Sensor, BreaksOnceAfterStaleMsAndTellsItByANewEpoch) {
    Sensor sensor = make();
    (void)sensor.marker(0);
    const auto before = sensor.sample(frame(kMs, 1, 2, 3), kMs);
    EXPECT_FALSE(sensor.has_discontinuity(true, 101 * kMs));
    EXPECT_TRUE(sensor.has_discontinuity(true, 101 * kMs + 1));
    const auto marker = sensor.marker(102 * kMs);
    EXPECT_EQ(marker.quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(marker.reasons, unsigned(TACTILED_STALE));
    EXPECT_EQ(marker.t_ns, kMs);  // makes its age right
    EXPECT_EQ(marker.epoch, before.epoch + 1);
    EXPECT_FALSE(sensor.has_discontinuity(true, 300 * kMs));  // reported once
    EXPECT_TRUE(sensor.has_discontinuity(false, 301 * kMs));  // now for another reason
    EXPECT_EQ(sensor.marker(301 * kMs).reasons, unsigned(TACTILED_DISCONNECTED));
    const auto after = sensor.sample(frame(400 * kMs, 1, 2, 3), 400 * kMs);
    EXPECT_EQ(after.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(after.epoch, before.epoch + 1);
}

TEST(Sensor, BeforeTheFirstFrameItSaysSo) {
    Sensor sensor = make();
    EXPECT_EQ(sensor.marker(0).reasons, unsigned(TACTILED_NO_DATA_YET));
    EXPECT_TRUE(sensor.has_discontinuity(false, kMs));
    EXPECT_EQ(sensor.marker(kMs).reasons, unsigned(TACTILED_NO_DATA_YET | TACTILED_DISCONNECTED));
    EXPECT_EQ(sensor.marker(kMs).epoch, 7u << 16);  // no discontinuity yet
}

TEST(Sensor, ADisconnectedLinkBreaksAtOnce) {
    Sensor sensor = make();
    (void)sensor.sample(frame(kMs, 1, 2, 3), kMs);
    EXPECT_TRUE(sensor.has_discontinuity(false, kMs + 1));
}

TEST(Sensor, ContactHasHysteresisAndEndsWithTheValue) {
    Sensor sensor = make();
    sensor.set({.filter_Hz = 0, .contact_on_N = 1, .contact_off_N = 0.5, .overload_N = 4});
    const auto state = [&](double fx, std::uint64_t ms) { return sensor.sample(frame(ms * kMs, fx, 0, 0), ms * kMs).state; };
    EXPECT_EQ(state(0.9, 1), 0u);
    EXPECT_EQ(state(-1.0, 2), unsigned(TACTILED_CONTACT));  // whatever the direction
    EXPECT_EQ(state(0.6, 3), unsigned(TACTILED_CONTACT));
    EXPECT_EQ(state(0.4, 4), 0u);
    EXPECT_EQ(state(0.9, 5), 0u);
    EXPECT_EQ(state(4.5, 6), unsigned(TACTILED_CONTACT | TACTILED_OVERLOAD));
    ASSERT_TRUE(sensor.has_discontinuity(false, 7 * kMs));
    EXPECT_EQ(sensor.marker(7 * kMs).state, 0u);
    EXPECT_EQ(state(0.9, 8), 0u);  // it has to restart
    const double as_configured = std::nan("");
    sensor.set({as_configured, as_configured, as_configured, as_configured});
    EXPECT_EQ(state(4.5, 9), unsigned(TACTILED_CONTACT));  // configured: no overload
}

TEST(Sensor, ThePeakStaysUntilItIsReset) {
    Sensor sensor = make();
    (void)sensor.sample(frame(kMs, 3, 4, 0), kMs);
    EXPECT_FLOAT_EQ(sensor.sample(frame(2 * kMs, 1, 0, 0), 2 * kMs).peak_N, 5);
    sensor.reset_peak();
    EXPECT_FLOAT_EQ(sensor.sample(frame(3 * kMs, 2, 0, 0), 3 * kMs).peak_N, 2);
}

TEST(Sensor, TheLowPassHasItsCutoffWhateverTheRate) {
    for (const double rate_Hz : {500.0, 1000.0, 3333.0}) {
        Sensor sensor = make();
        sensor.set({.filter_Hz = 10, .contact_on_N = 1, .contact_off_N = 0.5, .overload_N = 0});
        double max = 0;
        for (int i = 0; i < int(3 * rate_Hz); ++i) {  // 10 Hz sine, 3 s
            const auto t = std::uint64_t(i / rate_Hz * 1e9) + 1;
            const auto s = sensor.sample(frame(t, std::sin(2 * 3.141592653589793 * 10 * i / rate_Hz), 0, 0), t);
            EXPECT_NE(s.state & TACTILED_LOW_PASS, 0u);
            if (i > int(2 * rate_Hz)) max = std::max(max, s.force_S_N[0]);
        }
        EXPECT_NEAR(max, std::sqrt(0.5), 0.02) << rate_Hz;  // -3 dB
    }
}

TEST(Sensor, TheLowPassStartsAnewAfterADiscontinuity) {
    Sensor sensor = make();
    sensor.set({.filter_Hz = 1, .contact_on_N = 1, .contact_off_N = 0.5, .overload_N = 0});
    EXPECT_EQ(sensor.sample(frame(kMs, 5, 0, 0), kMs).force_S_N[0], 5);  // no climb from 0
    EXPECT_LT(sensor.sample(frame(2 * kMs, 1, 0, 0), 2 * kMs).force_S_N[0], 5);
    EXPECT_GT(sensor.sample(frame(3 * kMs, 1, 0, 0), 3 * kMs).force_S_N[0], 4.5);
    ASSERT_TRUE(sensor.has_discontinuity(false, 4 * kMs));
    (void)sensor.marker(4 * kMs);
    EXPECT_EQ(sensor.sample(frame(5 * kMs, 1, 0, 0), 5 * kMs).force_S_N[0], 1);
}

TEST(Sensor, WhatTheLowPassSawOfADoubtfulValueIsInNoGoodOne) {
    Sensor sensor = make();
    sensor.set({.filter_Hz = 1, .contact_on_N = 1, .contact_off_N = 0.5, .overload_N = 0});
    for (std::uint64_t t = 1; t <= 5; ++t) (void)sensor.sample(frame(t * kMs, 1, 0, 0), t * kMs);
    EXPECT_EQ(sensor.sample(frame(6 * kMs, 1000, 0, 0), 6 * kMs).quality,
              unsigned(TACTILED_UNCERTAIN));  // its saturation limit
    const auto s = sensor.sample(frame(7 * kMs, 1, 0, 0), 7 * kMs);
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(s.force_S_N[0], 1);
}

TEST(Sensor, MeasuresItsRate) {
    Sensor sensor = make();
    tactiled_sample s{};
    for (std::uint64_t i = 0; i <= 1100; ++i) s = sensor.sample(frame(i * kMs, 0, 0, 0), i * kMs);
    EXPECT_NEAR(double(s.rate_Hz), 1000, 0.1);
}

TEST(Sensor, CountsWhatTheDriverKnowsToBeLost) {
    Sensor sensor = make();
    Frame f = frame(kMs, 1, 2, 3);
    f.lost = 3;
    EXPECT_EQ(sensor.sample(f, kMs).lost, 3u);
    EXPECT_EQ(sensor.sample(f, kMs).lost, 6u);
}

TEST(Sensor, AFrameThatIsOlderThanStaleMsHasNoValueAndBeginsAnEpoch) {
    Sensor sensor = make();
    EXPECT_EQ(sensor.sample(frame(500 * kMs, 1, 2, 3), 500 * kMs).quality, unsigned(TACTILED_GOOD));
    Frame late = frame(400 * kMs, 4, 5, 6);
    late.late_ns = 101 * kMs;
    tactiled_sample s = sensor.sample(late, 501 * kMs);
    EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(s.reasons, unsigned(TACTILED_STALE));
    EXPECT_TRUE(std::isnan(s.force_S_N[0]));
    EXPECT_FALSE(sensor.is_delivering());
    EXPECT_EQ(sensor.sample(late, 502 * kMs).epoch, s.epoch) << "one break, however many are late";
    late.late_ns = 99 * kMs;
    const tactiled_sample young = sensor.sample(late, 503 * kMs);
    EXPECT_EQ(young.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(young.epoch, s.epoch);
    EXPECT_NE(young.epoch, 7u << 16);
}

}  // namespace
}  // namespace tactiled
