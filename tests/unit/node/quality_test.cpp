// The judgement of a stream by its times and raw numbers, through a complete sensor.
#include "node/quality.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "node/sensor.hpp"
#include "tests/unit/milliseconds.hpp"
#include "through.hpp"

namespace tactiled {
namespace {

class Stream {
public:
    explicit Stream(const std::function<void(Tuning&)>& tune) : sensor_(setup(tune)) { sensor_.start(7, 0); }
    tactiled_sample send(double a, double b, double c, std::uint64_t after_ms = 1, std::uint32_t lost = 0) {
        Frame f;
        t_ns_ += after_ms * kMs;
        f.t_ns = t_ns_;
        f.n_channels = 3;
        f.channel = {a, b, c};
        f.lost = lost;
        f.opening = opening;
        return sensor_.sample(f, t_ns_);
    }
    Sensor& sensor() { return sensor_; }
    std::uint32_t opening = 0;
    std::uint64_t& t_ns() { return t_ns_; }

private:
    static Sensor::Setup setup(const std::function<void(Tuning&)>& tune) {
        Sensor::Setup setup;
        setup.channel_of_frame = {0, 1, 2};
        setup.frame_channels = 3;
        setup.tuning.saturates_at[1] = 8'388'607;
        tune(setup.tuning);
        setup.decoupler = std::make_unique<Through>(INFINITY, kNaN);
        return setup;
    }
    Sensor sensor_;
    std::uint64_t t_ns_ = 0;
};

constexpr unsigned kGood = TACTILED_GOOD, kUncertain = TACTILED_UNCERTAIN, kBad = TACTILED_BAD;

TEST(StreamQuality, AChannelThatRepeatsItselfHasNoValueUntilItHasChangedTwice) {
    Stream stream([](Tuning& t) { t.frozen_of.fill({5, 0}); });
    const auto before = stream.send(1, 1, 7);
    for (int i = 2; i < 5; ++i) EXPECT_EQ(stream.send(i, -i, 7).quality, kGood) << i;
    auto s = stream.send(5, -5, 7);
    EXPECT_EQ(s.quality, kBad);
    EXPECT_EQ(s.reasons, unsigned(TACTILED_FROZEN));  // not also a missing channel: one cause, one counter
    EXPECT_EQ(s.missing, 0b100u);
    EXPECT_TRUE(std::isnan(s.force_S_N[0]));
    EXPECT_EQ(s.epoch, before.epoch + 1);
    EXPECT_EQ(stream.send(6, -6, 8).quality, kBad);
    s = stream.send(7, -7, 9);
    EXPECT_EQ(s.quality, kGood);
    EXPECT_EQ(s.epoch, before.epoch + 1);
}

TEST(StreamQuality, ADeviceThatComesBackWithTheSameNumberIsStillFrozen) {
    Stream stream([](Tuning& t) { t.frozen_of.fill({5, 0}); });
    for (int i = 0; i < 6; ++i) (void)stream.send(i, -i, 7);
    ASSERT_TRUE(stream.sensor().has_discontinuity(false, stream.t_ns()));
    EXPECT_EQ(stream.send(9, 9, 7).quality, kBad);
    EXPECT_EQ(stream.send(10, 8, 7).reasons, unsigned(TACTILED_FROZEN));
}

TEST(StreamQuality, ADeadChannelStaysDeadUnderAnotherCalibration) {
    Stream stream([](Tuning& t) { t.frozen_of.fill({5, 0}); });
    for (int i = 0; i < 6; ++i) (void)stream.send(i, -i, 7);
    Stream next([](Tuning& t) { t.frozen_of.fill({5, 0}); });
    next.sensor().succeed(stream.sensor());
    next.t_ns() = stream.t_ns();
    EXPECT_EQ(next.send(6, -6, 7).reasons, unsigned(TACTILED_FROZEN));
    (void)next.send(7, -7, 8);
    EXPECT_EQ(next.send(8, -8, 9).quality, kGood);
}

TEST(StreamQuality, ALinkThatWasOpenedAnewBetweenTwoFramesIsADiscontinuityThoughNobodySawIt) {
    Stream stream([](Tuning&) {});
    const auto before = stream.send(1, 2, 3);
    stream.opening = 1;
    EXPECT_EQ(stream.send(1, 2, 3).epoch, before.epoch + 1);
    EXPECT_EQ(stream.send(1, 2, 3).epoch, before.epoch + 1);
    ASSERT_TRUE(stream.sensor().has_discontinuity(false, stream.t_ns()));  // seen: one discontinuity, not two
    stream.opening = 2;
    EXPECT_EQ(stream.send(1, 2, 3).epoch, before.epoch + 2);
}

TEST(StreamQuality, ASaturationLimitRepeatsRightly) {
    Stream stream([](Tuning& t) { t.frozen_of.fill({5, 0}); });
    for (int i = 0; i < 20; ++i) EXPECT_EQ(stream.send(i, -i, 8'388'607).reasons, unsigned(TACTILED_SATURATED)) << i;
    for (int i = 0; i < 6; ++i) (void)stream.send(i, -i, 7);
    (void)stream.send(1, 2, 8'388'607);
    (void)stream.send(2, 3, 8'388'607);
    EXPECT_EQ(stream.send(3, 4, 7).reasons, unsigned(TACTILED_FROZEN));  // it is not a sign of life, either
}

TEST(StreamQuality, EachChannelHasItsOwnLimitWhichIsATimeToo) {
    Stream stream([](Tuning& t) {
        t.frozen_of[1] = {.after = 5, .ns = 20 * kMs};
        t.frozen_of[2] = {.after = 10, .ns = 0};
    });
    for (int i = 0; i < 9; ++i) EXPECT_EQ(stream.send(7, 7, 7).quality, kGood) << i;
    auto s = stream.send(7, 7, 7);
    EXPECT_EQ(s.missing, 0b100u);  // ten readings in 9 ms
    for (int i = 0; i < 10; ++i) s = stream.send(7, 7, i);
    EXPECT_EQ(s.reasons, 0u);  // 19 ms
    for (int i = 0; i < 10; ++i) s = stream.send(7, 7, i);
    EXPECT_EQ(s.reasons, unsigned(TACTILED_FROZEN));
    EXPECT_EQ(s.missing, 0b010u);  // the first one may repeat for ever
}

TEST(StreamQuality, WithoutALimitAQuietSensorMayRepeatItself) {
    Stream stream([](Tuning&) {});
    for (int i = 0; i < 1000; ++i) ASSERT_EQ(stream.send(1, 2, 3).quality, kGood);
}

TEST(StreamQuality, AnIdleBusIsNoValueWithinEightReadingsOfThreeChannels) {
    for (const double idle : {0.0, -1.0, 65535.0}) {
        Stream stream([](Tuning& t) {
            t.frozen_of.fill({100, 0});
            t.noisy = true;
        });
        (void)stream.send(5, 6, 7);
        for (int i = 0; i < 7; ++i) EXPECT_EQ(stream.send(idle, idle, idle).quality, kGood) << idle;
        const auto s = stream.send(idle, idle, idle);
        EXPECT_EQ(s.quality, kBad) << idle;
        EXPECT_EQ(s.reasons, unsigned(TACTILED_IDLE_BUS)) << idle;
        EXPECT_EQ(stream.send(5, 6, 7).quality, kGood) << idle;
    }
    Stream quiet([](Tuning& t) { t.frozen_of.fill({100, 0}); });
    for (int i = 0; i < 50; ++i) EXPECT_EQ(quiet.send(0, 0, 0).quality, kGood);  // a sensor of few bits, at rest
}

TEST(StreamQuality, AnotherRateThanDeclaredIsReportedAndTheValueStaysGood) {
    Stream stream([](Tuning& t) {
        t.rate_Hz = 1000;
        t.rate_tolerance = 0.2;
    });
    std::uint32_t reasons = 0;
    const auto run = [&](int frames, std::uint64_t every_ms) {
        tactiled_sample s{};
        for (int i = 0; i < frames; ++i) {
            s = stream.send(1, 2, 3, every_ms);
            EXPECT_EQ(s.quality, kGood);
            reasons |= s.reasons;
        }
        return s;
    };
    (void)run(2500, 1);
    EXPECT_EQ(reasons, 0u);
    auto s = run(1100, 2);
    EXPECT_EQ(s.reasons, unsigned(TACTILED_WRONG_RATE));
    EXPECT_NEAR(double(s.rate_Hz), 500, 5);
    s = run(2100, 1);
    EXPECT_EQ(s.reasons, 0u);
    EXPECT_TRUE(stream.sensor().can_tare());
}

TEST(StreamQuality, AZeroThatWandersAtRestAsksForMaintenanceAndAPressDoesNot) {
    Stream stream([](Tuning& t) { t.drift_limit_N = 0.2; });
    tactiled_sample s{};
    const auto run = [&](int ms, double fz_N) {
        for (int i = 0; i < ms; ++i) s = stream.send(0, 0, fz_N);
    };
    run(3000, 0.1);
    EXPECT_EQ(s.reasons, 0u);
    run(5000, -5);  // contact
    EXPECT_EQ(s.reasons, 0u);
    run(900, 0.24);  // not yet: needs a mean over a second at rest
    EXPECT_EQ(s.reasons, 0u);
    run(3000, 0.24);
    EXPECT_EQ(s.reasons, unsigned(TACTILED_DRIFTED));
    EXPECT_EQ(s.quality, kGood);
    ASSERT_TRUE(stream.sensor().can_tare());  // the remedy
    run(8000, 0.05);
    EXPECT_EQ(s.reasons, 0u);
}

// Every limit is on, as tight as the device allows, with a healthy device: noise of a 24-bit converter near its zero,
// hum, presses, timestamps that jitter by a third of a period, backlogs, single lost frames.
TEST(StreamQuality, AMillionGoodSamplesAreAllGood) {
    Stream stream([](Tuning& t) {
        t.stale_ns = 20 * kMs;
        t.frozen_of.fill({100, 0});
        t.noisy = true;
        t.rate_Hz = 1000;
        t.drift_limit_N = 1e9;
    });
    std::mt19937_64 random(1);
    std::normal_distribution<double> noise(0, 1.5);
    std::uniform_real_distribution<double> jitter_ms(-0.33, 0.33);
    std::uint64_t bad = 0, reasons = 0;
    double held_ms = 0;
    for (int i = 1; i <= 1'000'000; ++i) {
        if (i % 50'000 == 0) held_ms = i + 15;  // the host is stopped: frames meanwhile get one timestamp
        if (i % 70'001 == 0) continue;          // lost
        const double t_ms = std::max(double(i) + jitter_ms(random), held_ms);
        const double hum = 5 * std::sin(2 * std::numbers::pi * 0.05 * i);
        const int phase = std::max(i % 5000 - 2000, 0);  // two presses of 1.5 s, then rest
        const double press = 300'000 * (1 - std::cos(2 * std::numbers::pi * phase / 1500.0));
        stream.t_ns() = std::uint64_t(t_ms * 1e6);
        const auto at = [&](double gain) { return std::round(gain * (press + hum) + noise(random)); };
        if (stream.sensor().has_discontinuity(true, stream.t_ns())) ++bad;
        const auto s = stream.send(at(1), at(-0.2), at(0), 0, i % 70'001 == 1 && i > 1 ? 1 : 0);
        if (s.quality != kGood) ++bad;
        reasons |= s.reasons;
    }
    EXPECT_EQ(bad, 0u) << "reasons " << reasons;
    EXPECT_EQ(reasons, 0u);
}

TEST(StreamQuality, OfOtherChannelsNothingIsKnownAfterAReplacement) {
    Tuning tuning;
    tuning.frozen_of.fill({3, 0});
    StreamQuality before(tuning);
    Frame f;
    const std::array<double, 2> still{1, 2};
    std::uint32_t dead = 0;
    for (int i = 0; i < 3; ++i) {
        (void)before.arrive(f);
        (void)before.judge(still, 0b11, dead);
    }
    EXPECT_EQ(dead, 0b11u);
    for (const bool same_channels : {true, false}) {
        StreamQuality after(tuning);
        after.succeed(before, same_channels);
        EXPECT_EQ(after.discontinuities(), before.discontinuities() + 1);
        dead = 0;
        (void)after.arrive(f);
        (void)after.judge(still, 0b11, dead);
        EXPECT_EQ(dead, same_channels ? 0b11u : 0u);
    }
}

}  // namespace
}  // namespace tactiled
