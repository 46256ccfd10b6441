// The parts of the published standard deviation: what each stage adds, in `budget`.
#include <gtest/gtest.h>

#include "sensor_fixture.hpp"
#include "tactiled/uncertainty.h"

namespace tactiled {
namespace {

constexpr std::uint64_t kStep_ns = 10'000'000;
constexpr double kSd_N = 0.01, kNoise_N = 0.004, kReference = 0.003, kWarm_N = 0.002;

// The channels are fx fy fz, with every part that a model states.
class Stated final : public Decoupler {
public:
    Stated() {
        correlations_.between[Correlations::index(0, 2)] = 0.5f;
        correlations_.full_scale = {10, 10, 20, 1, 1, 1};
        correlations_.alike = 0.9f;
        correlations_.alike_within = 0.5f;
        correlations_.model = 7;
    }
    Estimate decouple(const Reading& r) noexcept override {
        Estimate e;
        for (std::size_t c = 0; c < 3; ++c) {
            e.wrench_S[c] = r.channel[c];
            e.noise[c] = kNoise_N;
            e.reference[c] = kReference * r.channel[c];
            e.temperature[c] = kWarm_N;
            e.sd[c] = std::hypot(kSd_N, kReference * r.channel[c], kWarm_N);
        }
        e.correlations = &correlations_;
        e.has_value = true;
        return e;
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "stated"; }

private:
    Correlations correlations_;
};

class SensorBudget : public ::testing::Test {
protected:
    void make(double zero_per_h_N, double delay_s = 0, double filter_Hz = 0) {
        Sensor::Setup setup;
        setup.channel_of_frame = {0, 1, 2};
        setup.frame_channels = 3;
        setup.tuning.saturates_at = {-1000, 1000};
        setup.tuning.filter_hz = filter_Hz;
        setup.tuning.delay_s.assign(3, delay_s);
        for (std::size_t c = 0; c < 3; ++c) {
            setup.zero.per_s[c] = zero_per_h_N / 3600;
            setup.zero.limit[c] = 100;
        }
        setup.decoupler = std::make_unique<Stated>();
        sensor_ = std::make_unique<Sensor>(std::move(setup));
        sensor_->start(7, 0);
    }
    const tactiled_placed& press(double fz_N, std::uint64_t after_ns = kStep_ns) {
        t_ns_ += after_ns;
        (void)sensor_->sample(frame(t_ns_, 1, -2, fz_N), t_ns_);
        return sensor_->placed();
    }
    static double part(const tactiled_placed& p, tactiled_part part, int c) { return double(p.budget.sd_part[part][c]); }
    static double sum_of_squares(const tactiled_placed& p, int c) {
        double sum = 0;
        for (const auto& of : p.budget.sd_part) sum += double(of[c]) * double(of[c]);
        return sum;
    }

    std::unique_ptr<Sensor> sensor_;
    std::uint64_t t_ns_ = kStep_ns;
};

TEST_F(SensorBudget, HasThePartsOfTheModel) {
    make(0);
    const tactiled_placed& p = press(-5);
    EXPECT_NEAR(part(p, TACTILED_OF_NOISE, 2), kNoise_N, 1e-9);
    EXPECT_NEAR(part(p, TACTILED_OF_REFERENCE, 2), -5 * kReference, 1e-9) << "with the sign of the component";
    EXPECT_NEAR(part(p, TACTILED_OF_TEMPERATURE, 2), kWarm_N, 1e-9);
    EXPECT_NEAR(part(p, TACTILED_OF_CALIBRATION, 2), std::sqrt(kSd_N * kSd_N - kNoise_N * kNoise_N), 1e-8);
    EXPECT_EQ(part(p, TACTILED_OF_ZERO, 2), 0);
    EXPECT_EQ(part(p, TACTILED_OF_MOTION, 2), 0);
    EXPECT_EQ(p.budget.correlation[1], 0.5f);
    EXPECT_EQ(p.budget.load[2], -0.25f);
    EXPECT_EQ(p.budget.load[3], 0) << "not measured";
    EXPECT_EQ(p.budget.model, 7u);
    EXPECT_TRUE(std::isnan(part(p, TACTILED_OF_NOISE, 4))) << "the sd of a torque is not known";
}

TEST_F(SensorBudget, AddsUpToTheVariance) {
    make(3.6, 0.02, 2);
    for (int k = 0; k < 500; ++k) {
        const tactiled_placed& p = press(-5 - (k > 250 ? 0.01 * k : 0));
        for (int c = 0; c < 3; ++c)
            ASSERT_NEAR(std::sqrt(sum_of_squares(p, c)) / p.sample.sd_force_N[c], 1, 1e-6) << k << " " << c;
    }
    EXPECT_GT(part(sensor_->placed(), TACTILED_OF_ZERO, 2), 1e-3);
    EXPECT_GT(part(sensor_->placed(), TACTILED_OF_MOTION, 2), 1e-2);
    EXPECT_EQ(tactiled_largest_part(&sensor_->placed()), unsigned(TACTILED_OF_MOTION));
}

TEST_F(SensorBudget, IsNotKnownWithoutAValue) {
    make(0);
    (void)press(-5);
    (void)sensor_->marker(t_ns_);
    const tactiled_placed& p = sensor_->placed();
    EXPECT_EQ(p.sample.quality, unsigned(TACTILED_BAD));
    EXPECT_TRUE(std::isnan(part(p, TACTILED_OF_NOISE, 2)) && std::isnan(p.budget.load[0]));
    EXPECT_EQ(p.budget.model, 0u);
}

}  // namespace
}  // namespace tactiled
