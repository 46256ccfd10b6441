// Tares of a sensor, and the values of which no zero is taken.
#include <gtest/gtest.h>

#include <cmath>

#include "sensor_fixture.hpp"

namespace tactiled {
namespace {

TEST(Sensor, TareAveragesAndKeepsTheRawForce) {
    Sensor sensor = make();
    (void)sensor.sample(frame(kMs, 5, 0, -3), kMs);
    ASSERT_TRUE(sensor.can_tare());
    sensor.begin_tare(10 * kMs);
    tactiled_sample s{};
    for (std::uint64_t t = 9; t <= 110; ++t) s = sensor.sample(frame(t * kMs, t % 2 ? 4.0 : 6.0, 1, -3), t * kMs);
    EXPECT_EQ(sensor.poll_tare(110 * kMs), Sensor::Tare::done);
    EXPECT_EQ(sensor.poll_tare(110 * kMs), Sensor::Tare::none);
    s = sensor.sample(frame(111 * kMs, 5, 1, -4), 111 * kMs);
    EXPECT_NEAR(s.force_S_N[0], 0, 0.02);  // N; an odd number of alternating samples
    EXPECT_EQ(s.force_S_N[1], 0);
    EXPECT_EQ(s.force_S_N[2], -1);
    EXPECT_EQ(s.raw_force_S_N[2], -4);
    EXPECT_EQ(s.tare_count, 1u);
    EXPECT_EQ(s.reasons & TACTILED_TARING, 0u);
    sensor.begin_untare();
    EXPECT_EQ(sensor.poll_tare(112 * kMs), Sensor::Tare::removing);  // not acknowledged before a sample shows it
    EXPECT_EQ(sensor.sample(frame(112 * kMs, 5, 1, -4), 112 * kMs).force_S_N[2], -4);
    EXPECT_EQ(sensor.poll_tare(112 * kMs), Sensor::Tare::done);
}

TEST(Sensor, ATareNeedsATrustworthyValueAllAlong) {
    Sensor sensor = make();
    EXPECT_FALSE(sensor.can_tare());  // no data yet
    (void)sensor.sample(frame(kMs, 1000, 0, 0), kMs);
    EXPECT_FALSE(sensor.can_tare());  // saturated
    (void)sensor.sample(frame(3 * kMs, 1, 0, 0), 3 * kMs);
    ASSERT_TRUE(sensor.can_tare());
    sensor.begin_tare(4 * kMs);
    Frame hole = frame(5 * kMs, 1, 0, 0);
    hole.missing = 1;
    (void)sensor.sample(hole, 5 * kMs);
    EXPECT_EQ(sensor.poll_tare(6 * kMs), Sensor::Tare::failed);
    const auto s = sensor.sample(frame(7 * kMs, 1, 0, 0), 7 * kMs);
    EXPECT_EQ(s.force_S_N[0], 1);  // the old zero stays
    EXPECT_EQ(s.tare_count, 0u);
}

TEST(Sensor, AZeroOfValuesOfUnknownUncertaintyIsUncertainUntilTheNextTare) {
    Sensor sensor = make(1, Through::kSd_N);
    const auto at_rest = [&](std::uint64_t at) {
        (void)sensor.sample(frame((at - 1) * kMs, 0, 0, 0), (at - 1) * kMs);
        return sensor.sample(frame(at * kMs, 0, 0, 0), at * kMs);
    };
    const auto tare = [&](std::uint64_t at, std::uint64_t unsure) {
        (void)sensor.sample(frame(at * kMs, 0, 0, 0), at * kMs);
        ASSERT_TRUE(sensor.can_tare());
        sensor.begin_tare(at * kMs);
        for (std::uint64_t t = at; t <= at + 100; ++t)
            (void)sensor.sample(frame(t * kMs, 0, t < at + unsure ? 100.001 : 99.999, 0), t * kMs);
        ASSERT_EQ(sensor.poll_tare((at + 100) * kMs), Sensor::Tare::done);
    };
    tare(10, 5);
    const auto s = at_rest(200);
    EXPECT_EQ(s.quality, unsigned(TACTILED_UNCERTAIN));
    EXPECT_TRUE(std::isnan(s.sd_force_N[1]));
    tare(300, 0);
    EXPECT_EQ(at_rest(500).quality, unsigned(TACTILED_GOOD));
    tare(600, 5);
    sensor.begin_untare();
    EXPECT_EQ(at_rest(802).quality, unsigned(TACTILED_GOOD));
}

TEST(Sensor, ATareOfASilentSensorFails) {
    Sensor sensor = make();
    (void)sensor.sample(frame(kMs, 1, 2, 3), kMs);
    ASSERT_TRUE(sensor.can_tare());
    sensor.begin_tare(2 * kMs);
    ASSERT_TRUE(sensor.has_discontinuity(true, 200 * kMs));
    EXPECT_EQ(sensor.poll_tare(200 * kMs), Sensor::Tare::failed);
}

TEST(Sensor, AnAgeThatIsNotProvedIsUncertainAndNoZeroIsTakenOfIt) {
    Sensor sensor = make();
    Frame f = frame(kMs, 1, 2, 3);
    EXPECT_EQ(sensor.sample(f, kMs).quality, unsigned(TACTILED_GOOD));
    EXPECT_TRUE(sensor.can_tare());
    f.age = Frame::Age::unproved;
    tactiled_sample s = sensor.sample(f, 2 * kMs);
    EXPECT_EQ(s.quality, unsigned(TACTILED_UNCERTAIN));
    EXPECT_EQ(s.reasons, unsigned(TACTILED_UNPROVED_AGE));
    EXPECT_FALSE(sensor.can_tare());
    f.age = Frame::Age::arrival_only;
    s = sensor.sample(f, 3 * kMs);
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(s.reasons, unsigned(TACTILED_ARRIVAL_ONLY));
    EXPECT_FALSE(sensor.can_tare());
    f.age = Frame::Age::proved;
    (void)sensor.sample(f, 4 * kMs);
    ASSERT_TRUE(sensor.can_tare());
    sensor.begin_tare(4 * kMs);
    f.age = Frame::Age::unproved;
    f.t_ns = 5 * kMs;
    (void)sensor.sample(f, 5 * kMs);
    EXPECT_EQ(sensor.poll_tare(5 * kMs), Sensor::Tare::failed) << "a lag in the middle of a tare";
}

TEST(Sensor, AStreamWithoutClockAndCounterIsTaredWhereTheUserAcceptsIt) {
    Sensor::Setup setup;
    setup.channel_of_frame = {0, 1, 2};
    setup.frame_channels = 3;
    setup.tuning.accept_unproved_age = true;
    setup.decoupler = std::make_unique<Through>(100, kNaN);
    Sensor sensor(std::move(setup));
    sensor.start(7, 0);
    Frame f = frame(kMs, 1, 2, 3);
    f.age = Frame::Age::arrival_only;
    EXPECT_EQ(sensor.sample(f, kMs).reasons, 0u);
    EXPECT_TRUE(sensor.can_tare());
    f.age = Frame::Age::unproved;
    EXPECT_EQ(sensor.sample(f, 2 * kMs).quality, unsigned(TACTILED_UNCERTAIN));
    EXPECT_FALSE(sensor.can_tare());
}

}  // namespace
}  // namespace tactiled
