// A sensor whose value jumps; a sensor whose calibration needs a tare.
#include <gtest/gtest.h>

#include "sensor_fixture.hpp"

namespace tactiled {
namespace {

class Jumping {
public:
    explicit Jumping(double filter_Hz = 0) : sensor_(make(1, Through::kSd_N)) {
        sensor_.set({.filter_Hz = filter_Hz, .contact_on_N = 1, .contact_off_N = 0.5, .overload_N = 10});
        for (int i = 0; i < 50; ++i) (void)send(0);
    }
    tactiled_sample send(double fz_N) {
        t_ns_ += kMs;
        return sensor_.sample(frame(t_ns_, 0, 0, fz_N), t_ns_);
    }
    Sensor& sensor() { return sensor_; }
    std::uint64_t t_ns() const { return t_ns_; }

private:
    Sensor sensor_;
    std::uint64_t t_ns_ = 0;
};

TEST(SensorJump, ContactAndOverloadDoNotWaitForAConfirmation) {
    Jumping jumping;
    const auto jump = jumping.send(-20);
    EXPECT_EQ(jump.quality, unsigned(TACTILED_UNCERTAIN));
    EXPECT_EQ(jump.reasons, unsigned(TACTILED_STEPPED));
    EXPECT_EQ(jump.force_S_N[2], -20);
    EXPECT_EQ(jump.state & (TACTILED_CONTACT | TACTILED_OVERLOAD), unsigned(TACTILED_CONTACT | TACTILED_OVERLOAD));
    EXPECT_EQ(jump.peak_N, 0);
    const auto after = jumping.send(0.7);
    EXPECT_EQ(after.state & TACTILED_CONTACT, 0u) << "the jump was no contact that has to end";
    EXPECT_EQ(jumping.send(0.7).quality, unsigned(TACTILED_GOOD));
    EXPECT_NEAR(double(jumping.send(0.7).peak_N), 0.7, 1e-6);
}

TEST(SensorJump, AGlitchDoesNotReachTheLowPass) {
    Jumping filtered(50);
    const auto glitch = filtered.send(-20);
    EXPECT_EQ(glitch.force_S_N[2], 0);
    EXPECT_GT(glitch.sd_force_N[2], 19);
    const auto after = filtered.send(0);
    EXPECT_EQ(after.quality, unsigned(TACTILED_GOOD));
    EXPECT_NEAR(after.force_S_N[2], 0, 1e-9);
    EXPECT_LT(after.sd_force_N[2], 2 * Through::kSd_N);
    (void)filtered.send(-20);
    EXPECT_LT(filtered.send(-20).force_S_N[2], -1) << "a step is filtered from its second sample on";
}

TEST(SensorJump, AGlitchIsNoPartOfAZero) {
    Jumping jumping;
    ASSERT_TRUE(jumping.sensor().can_tare());
    jumping.sensor().begin_tare(jumping.t_ns());
    for (int i = 0; i < 120; ++i) (void)jumping.send(i == 50 ? -20 : 0.1);
    EXPECT_EQ(jumping.sensor().poll_tare(jumping.t_ns()), Tare::done);
    EXPECT_NEAR(jumping.send(0.1).force_S_N[2], 0, 1e-9);
}

TEST(SensorJump, FrequentGlitchesAreAReasonOfTheirOwnThatEnds) {
    Jumping jumping;
    tactiled_sample s{};
    for (int i = 0; i < 1000; ++i) s = jumping.send(i % 50 == 7 ? -20 : 0);
    EXPECT_EQ(s.quality, unsigned(TACTILED_UNCERTAIN));
    EXPECT_EQ(s.reasons, unsigned(TACTILED_GLITCHES));
    for (int i = 0; i < 30'000; ++i) s = jumping.send(0);
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
}

TEST(SensorJump, ACalibrationWithAZeroPerSessionNeedsATare) {
    Sensor::Setup setup;
    setup.channel_of_frame = {0, 1, 2};
    setup.frame_channels = 3;
    setup.needs_tare = true;
    setup.decoupler = std::make_unique<Through>(100, kNaN);
    Sensor sensor(std::move(setup));
    sensor.start(7, 0);
    std::uint64_t t_ns = 0;
    const auto send = [&] {
        t_ns += kMs;
        return sensor.sample(frame(t_ns, 0, 0, 1), t_ns);
    };
    auto s = send();
    EXPECT_EQ(s.quality, unsigned(TACTILED_UNCERTAIN));
    EXPECT_NE(s.reasons & TACTILED_ZERO_UNKNOWN, 0u);
    EXPECT_TRUE(std::isnan(s.sd_force_N[2]));
    ASSERT_TRUE(sensor.can_tare());
    sensor.begin_tare(t_ns);
    for (int i = 0; i < 120; ++i) s = send();
    EXPECT_EQ(sensor.poll_tare(t_ns), Tare::done);
    EXPECT_EQ(s.reasons & TACTILED_ZERO_UNKNOWN, 0u);
    EXPECT_EQ(s.force_S_N[2], 0);
    sensor.begin_untare();
    EXPECT_NE(send().reasons & TACTILED_ZERO_UNKNOWN, 0u);
}

}  // namespace
}  // namespace tactiled
