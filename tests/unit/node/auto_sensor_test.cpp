// A sensor with method "auto": the method in its samples, and a tare after a step.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "tests/unit/milliseconds.hpp"

#include "node/sensor.hpp"

namespace tactiled {
namespace {

// fz is the channel plus its own offset; after forget(), the first `unsure` values have no standard deviation.
class Offset final : public Decoupler {
public:
    Offset(std::string_view name, double offset_N, int unsure) : name_(name), offset_N_(offset_N), unsure_(unsure) {}
    Estimate decouple(const Reading& reading) noexcept override {
        Estimate e;
        if (reading.missing != 0) {
            forget();
            return e;
        }
        e.wrench_S[2] = reading.channel[0] + offset_N_;
        const bool knows = left_ == 0;
        left_ = std::max(left_ - 1, 0);
        e.sd[2] = knows ? 0.01 : kNaN;
        e.has_value = true;
        e.reasons = knows ? 0u : std::uint32_t(TACTILED_UNKNOWN_UNCERTAINTY);
        return e;
    }
    void forget() noexcept override { left_ = unsure_; }
    std::string_view method() const noexcept override { return name_; }

private:
    std::string_view name_;
    double offset_N_;
    int unsure_, left_ = 0;
};

std::uint64_t clock_now_ns = 0, clock_step_ns = 0;  // duration of each reading of the clock
std::uint64_t test_clock() noexcept { return clock_now_ns += clock_step_ns; }

struct Bench {
    explicit Bench(int fast_unsure = 0, int slow_unsure = 0) : sensor(setup(fast_unsure, slow_unsure)) {
        sensor.start(7, 0);
        clock_step_ns = 1000;
    }
    static Sensor::Setup setup(int fast_unsure, int slow_unsure) {
        std::vector<FrontMethod> front;
        front.push_back({{"slow", 5}, 0.01, std::make_unique<Offset>("slow", 0.25, slow_unsure)});
        front.push_back({{"fast", 1}, 0.02, std::make_unique<Offset>("fast", -0.5, fast_unsure)});
        auto automatic = std::make_unique<AutoMethod>(std::move(front), 10);
        Sensor::Setup s;
        s.channel_of_frame = {0};
        s.frame_channels = 1;
        s.clock_ns = &test_clock;
        s.automatic = automatic.get();
        s.decoupler = std::move(automatic);
        return s;
    }
    tactiled_sample next(double channel) {
        Frame f;
        f.t_ns = t_ns += kMs;
        f.n_channels = 1;
        f.channel[0] = channel;
        return sensor.sample(f, f.t_ns);
    }
    tactiled_sample after(int samples, double channel) {
        tactiled_sample s{};
        for (int i = 0; i < samples; ++i) s = next(channel);
        return s;
    }
    void tare(double channel) {
        ASSERT_TRUE(sensor.can_tare());
        sensor.begin_tare(t_ns);
        (void)after(110, channel);
        ASSERT_EQ(sensor.poll_tare(t_ns), Sensor::Tare::done);
    }
    Sensor sensor;
    std::uint64_t t_ns = 0;
};

TEST(AutoSensor, EachSampleSaysWhichMethodMadeItAndWhetherItStepped) {
    Bench bench;
    tactiled_sample s = bench.next(-1);
    EXPECT_EQ(TACTILED_METHOD(s.state), 1u);
    EXPECT_EQ(TACTILED_STEPS(s.state), 0u);
    EXPECT_EQ(s.state & (TACTILED_STEPPED_DOWN | TACTILED_OVER_BUDGET), 0u);
    clock_step_ns = 20'000;  // 20 us a sample, the budget is 10
    int by_slow = 0;
    for (int i = 0; i < 200; ++i) {
        s = bench.next(-1);
        ASSERT_EQ(s.force_S_N[2], TACTILED_METHOD(s.state) == 1 ? -0.75 : -1.5) << i;  // the value of that method
        by_slow += TACTILED_METHOD(s.state) == 1 ? 1 : 0;
    }
    EXPECT_LE(by_slow, 72);  // nine timed ones, one in eight
    EXPECT_EQ(TACTILED_METHOD(s.state), 2u);
    EXPECT_EQ(TACTILED_STEPS(s.state), 1u);
    EXPECT_NE(s.state & TACTILED_STEPPED_DOWN, 0u);
    EXPECT_NE(s.state & TACTILED_OVER_BUDGET, 0u);  // 20 us exceed the budget of the fast one, too
    clock_step_ns = 4'000;
    s = bench.after(600, -1);
    EXPECT_EQ(s.state & TACTILED_OVER_BUDGET, 0u);
}

TEST(AutoSensor, ATareHoldsForTheMethodThatComesAfterIt) {
    Bench bench;
    (void)bench.after(10, -1);
    bench.tare(-1);
    EXPECT_NEAR(bench.next(-1).force_S_N[2], 0, 1e-12);
    clock_step_ns = 20'000;
    const tactiled_sample s = bench.after(200, -3);
    ASSERT_EQ(TACTILED_METHOD(s.state), 2u);
    EXPECT_NEAR(s.force_S_N[2], -2, 1e-12);  // not -2.75, which the other method's zero would give
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(s.raw_force_S_N[2], -3.5);
    bench.sensor.begin_untare();
    EXPECT_EQ(bench.next(-3).force_S_N[2], -3.5);
    clock_step_ns = 1'000;
    const tactiled_sample back = bench.after(11'000, -3);  // calm enough for a step up
    ASSERT_EQ(TACTILED_METHOD(back.state), 1u);
    EXPECT_EQ(back.force_S_N[2], -2.75);
}

void expect_unsure(const tactiled_sample& s) {
    EXPECT_EQ(s.quality, unsigned(TACTILED_UNCERTAIN));
    EXPECT_NE(s.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);
    EXPECT_TRUE(std::isnan(s.sd_force_N[2]));
}

TEST(AutoSensor, AMethodWithoutATrueZeroIsUncertainUntilTheNextTare) {
    Bench bench(1);
    (void)bench.after(10, -1);
    bench.tare(-1);
    EXPECT_EQ(bench.next(-1).quality, unsigned(TACTILED_GOOD));
    clock_step_ns = 20'000;
    tactiled_sample s = bench.after(200, -3);
    ASSERT_EQ(TACTILED_METHOD(s.state), 2u);
    expect_unsure(s);
    bench.tare(-3);
    EXPECT_EQ(bench.next(-3).quality, unsigned(TACTILED_GOOD));
}

TEST(AutoSensor, ATareOfAMethodThatDoesNotKnowItsPastIsNoTrueZero) {
    Bench bench(0, 20);
    (void)bench.after(10, -1);
    (void)bench.next(std::nan(""));  // the past is lost
    (void)bench.next(-1);
    bench.tare(-1);
    tactiled_sample s = bench.after(50, -1);  // certain again: about the raw value
    ASSERT_EQ(TACTILED_METHOD(s.state), 1u);
    expect_unsure(s);
    bench.tare(-1);
    EXPECT_EQ(bench.next(-1).quality, unsigned(TACTILED_GOOD));
}

TEST(AutoSensor, ABadSampleIsNotTimed) {
    Bench bench;
    clock_step_ns = 20'000;
    tactiled_sample s = bench.after(200, -1);
    ASSERT_NE(s.state & TACTILED_OVER_BUDGET, 0u);
    clock_step_ns = 100;  // it returns early
    (void)bench.after(11'000, std::nan(""));
    s = bench.next(-1);
    EXPECT_EQ(TACTILED_METHOD(s.state), 2u);
    EXPECT_NE(s.state & TACTILED_OVER_BUDGET, 0u);
}

TEST(AutoSensor, DoesNotStepWhileATareIsMeasured) {
    Bench bench;
    (void)bench.after(10, -1);
    clock_step_ns = 20'000;
    bench.sensor.begin_tare(bench.t_ns);
    for (int i = 0; i < 99; ++i) ASSERT_EQ(TACTILED_METHOD(bench.next(-1).state), 1u) << i;
}

TEST(AutoSensor, ABadSampleNamesNoMethod) {
    Bench bench;
    EXPECT_EQ(bench.next(-1).state >> 16, 1u);
    EXPECT_EQ(bench.next(std::nan("")).state, 0u);
}

}  // namespace
}  // namespace tactiled
