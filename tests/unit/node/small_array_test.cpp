// Arrays in the channels of a frame.
#include <gtest/gtest.h>

#include "node/sensor.hpp"
#include "tests/bench/pressed_array.hpp"
#include "tests/unit/milliseconds.hpp"

namespace tactiled {
namespace {

// 2 x 3 taxels of three values in 18 channels, 10 ms apart.
class SmallArray : public testing::Test {
protected:
    SmallArray()
        : sensor_((setup_.frame_channels = 18, setup_.decoupler = make_decoupler(calibration()), std::move(setup_))) {
        sensor_.start(7, 0);
        sensor_.set({.contact_on_N = 1, .contact_off_N = 0.5, .overload_N = 100});
    }
    static Calibration calibration() {
        pressed::Array array;
        array.rows = 2, array.columns = 3, array.values = 3;
        return pressed::calibration_of(array);
    }
    tactiled_sample send(double press_N, std::uint32_t missing = 0) {
        t_ns_ += 10 * kMs;
        Frame f;
        f.t_ns = t_ns_;
        f.n_channels = 18;
        f.missing = missing;
        f.channel[3 * 4 + 2] = 1000 * press_N;  // z of the middle of the lower row
        return sensor_.sample(f, t_ns_);
    }

    Sensor::Setup setup_;
    Sensor sensor_;
    std::uint64_t t_ns_ = 0;
};

TEST_F(SmallArray, HasItsValuesTaxelByTaxel) {
    (void)send(0);
    (void)send(2);
    const tactiled_sample s = send(2);
    EXPECT_NEAR(s.raw_force_S_N[2], -2, 1e-5);
    EXPECT_NEAR(s.raw_torque_S_Nm[0], -1e-3 * -2, 1e-7);  // y fz, y = -1 mm
    EXPECT_NEAR(s.raw_torque_S_Nm[1], 0, 1e-7);
}

TEST_F(SmallArray, AMissingChannelIsAMissingTaxel) {
    (void)send(0);
    EXPECT_NEAR(send(0, 1u << 14).raw_force_S_N[2], 0, 1e-5);
    EXPECT_EQ(sensor_.patch()->shape().taxels, 6u);
    EXPECT_EQ(send(0, (1u << 18) - 1).quality, unsigned(TACTILED_BAD));
}

// Without a value for seconds the device may be another one, as for a sensor of channels.
TEST_F(SmallArray, AfterALongAbsenceAnotherForceIsNoKnownZero) {
    for (int k = 0; k < 200; ++k) (void)send(0);
    ASSERT_TRUE(sensor_.can_tare());
    sensor_.begin_tare(t_ns_);
    for (int k = 0; k < 200; ++k) (void)send(0);
    ASSERT_EQ(sensor_.poll_tare(t_ns_), Tare::done);
    EXPECT_EQ(send(0).quality, unsigned(TACTILED_GOOD));
    for (int k = 0; k < 500; ++k) (void)send(0, (1u << 18) - 1);
    (void)send(3);
    EXPECT_NE(send(3).reasons & TACTILED_ZERO_UNKNOWN, 0u);
}

}  // namespace
}  // namespace tactiled
