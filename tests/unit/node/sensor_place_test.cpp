// The centre of pressure of the published force.
#include <gtest/gtest.h>

#include "sensor_fixture.hpp"

namespace tactiled {
namespace {

constexpr std::uint64_t kStep_ns = 10'000'000;

// Channels are fz mx my; above `own_above_N` of press it finds a place by itself.
class Moments final : public Decoupler {
public:
    explicit Moments(double own_above_N) : own_above_N_(own_above_N) {}
    Estimate decouple(const Reading& r) noexcept override {
        Estimate e;
        for (std::size_t i = 0; i < 3; ++i) e.wrench_S[2 + i] = r.channel[i], e.sd[2 + i] = i == 0 ? 0.01 : 1e-5;
        e.correlations = &correlations_;
        if (-r.channel[0] > own_above_N_) e.cop_S_m = {7e-3, 8e-3}, e.cop_sd_m = {1e-4, 2e-4};
        e.has_value = true;
        return e;
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "moments"; }

private:
    static Correlations with_fz(float mx, float my) {
        Correlations result;
        result.between[Correlations::index(2, 3)] = mx;
        result.between[Correlations::index(2, 4)] = my;
        return result;
    }
    double own_above_N_;
    Correlations correlations_ = with_fz(0.5f, -0.5f);
};

class SensorPlace : public ::testing::Test {
protected:
    void make(double filter_Hz = 0, double own_above_N = 1e9) {
        Sensor::Setup setup;
        setup.channel_of_frame = {0, 1, 2};
        setup.frame_channels = 3;
        setup.tuning.saturates_at = {-1000, 1000};
        setup.tuning.filter_hz = filter_Hz;
        setup.decoupler = std::make_unique<Moments>(own_above_N);
        sensor_ = std::make_unique<Sensor>(std::move(setup));
        sensor_->start(7, 0);
    }
    // A press of `press_N` at (x, y), and a preload of 1 N at (-4, 2) mm.
    tactiled_sample press(double press_N, double x_m, double y_m, double preload_N = 0) {
        t_ns_ += kStep_ns;
        return sensor_->sample(
            frame(t_ns_, -press_N - preload_N, -y_m * press_N - 2e-3 * preload_N, x_m * press_N - 4e-3 * preload_N), t_ns_);
    }
    void tare() {
        (void)press(0, 0, 0, 1);
        sensor_->begin_tare(t_ns_);
        for (int k = 0; k < 400 && sensor_->poll_tare(t_ns_) == Tare::running; ++k) (void)press(0, 0, 0, 1);
    }

    std::unique_ptr<Sensor> sensor_;
    std::uint64_t t_ns_ = kStep_ns;
};

TEST_F(SensorPlace, IsThatOfTheWrench) {
    make();
    const tactiled_sample s = press(2, 3e-3, -1e-3);
    EXPECT_NEAR(s.cop_S_m[0], 3e-3, 1e-15);
    EXPECT_NEAR(s.cop_S_m[1], -1e-3, 1e-15);
    const double of_force = 3e-3 * 0.01;  // N m
    EXPECT_FLOAT_EQ(sensor_->placed().cop_sd_m[0], float(std::sqrt(1e-10 + of_force * of_force - 1e-5 * of_force) / 2));
}

TEST_F(SensorPlace, NoPlaceBelowFiveSdAndWithoutAValue) {
    make();
    EXPECT_TRUE(std::isnan(press(0.049, 3e-3, 0).cop_S_m[0]) && std::isnan(sensor_->placed().cop_sd_m[0]));
    EXPECT_FALSE(std::isnan(press(0.051, 3e-3, 0).cop_S_m[0]) || std::isnan(sensor_->placed().cop_sd_m[0]));
    (void)press(2, 3e-3, 0);
    const tactiled_sample bad = sensor_->marker(t_ns_);
    EXPECT_TRUE(std::isnan(bad.cop_S_m[0]) && std::isnan(sensor_->placed().cop_sd_m[0]));
}

TEST_F(SensorPlace, IsThatOfTheTaredForce) {
    make();
    tare();
    const tactiled_sample s = press(2, 3e-3, -1e-3, 1);
    ASSERT_EQ(s.tare_count, 1u);
    EXPECT_NEAR(s.cop_S_m[0], 3e-3, 1e-12);
    EXPECT_NEAR(s.cop_S_m[1], -1e-3, 1e-12);
    EXPECT_TRUE(std::isnan(press(0, 0, 0, 1).cop_S_m[0]));
}

TEST_F(SensorPlace, IsThatOfTheFilteredForce) {
    make(1);
    for (int k = 0; k < 100; ++k) (void)press(2, 3e-3, 0);
    const tactiled_sample s = press(2.05, 2e-3, 0);
    EXPECT_NEAR(s.cop_S_m[0], -s.torque_S_Nm[1] / s.force_S_N[2], 1e-15);
    EXPECT_NEAR(s.cop_S_m[0], 3e-3, 1e-4);
}

// A model that finds the place by itself knows that of the raw force.
TEST_F(SensorPlace, OfTheModelHoldsUntilATare) {
    make(0, 1.5);
    EXPECT_EQ(press(2, 3e-3, 0).cop_S_m[0], 7e-3);
    EXPECT_EQ(sensor_->placed().cop_sd_m[1], 2e-4f);
    EXPECT_NEAR(press(1.4, 3e-3, 0).cop_S_m[0], 3e-3, 1e-15);
    tare();
    EXPECT_NEAR(press(2, 3e-3, -1e-3, 1).cop_S_m[0], 3e-3, 1e-12);
}

}  // namespace
}  // namespace tactiled
