// Refused tares: of a force that moved, and beyond tare_limit_N.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "node/sensor.hpp"
#include "tests/unit/milliseconds.hpp"
#include "through.hpp"

namespace tactiled {
namespace {

struct Tared {
    Sensor::Tare end;
    tactiled_sample after;  // sample of the force (1, 2, -3) N
};

// Returns the result of a tare of 100 ms while the z force is force_N(i) at its i-th sample of `samples`.
template <typename Force>
Tared tare(unsigned samples, double limit_N, Force force_N) {
    Sensor::Setup setup;
    setup.channel_of_frame = {0, 1, 2};
    setup.frame_channels = 3;
    setup.tuning.tare_limit_of_magnitude_N = limit_N;
    setup.decoupler = std::make_unique<Through>();
    Sensor sensor(std::move(setup));
    sensor.start(7, 0);
    const auto send = [&](std::uint64_t t_ns, double x, double y, double z) {
        Frame f;
        f.t_ns = t_ns;
        f.n_channels = 3;
        f.channel = {x, y, z};
        return sensor.sample(f, t_ns);
    };
    (void)send(kMs, 0, 0, force_N(0));
    EXPECT_TRUE(sensor.can_tare());
    sensor.begin_tare(10 * kMs);
    constexpr unsigned kMore = 10;  // samples that are not confirmed do not count
    for (unsigned i = 0; i <= samples + kMore; ++i)
        (void)send(10 * kMs + i * 100 * kMs / samples, 0, 0, force_N(std::min(i, samples)));
    const auto end = sensor.poll_tare(110 * kMs);
    (void)send(500 * kMs, 1, 2, -3);
    return {end, send(510 * kMs, 1, 2, -3)};
}

TEST(Tare, OfAForceThatMovesIsRefusedAndTheZeroBeforeStays) {
    const auto moves = [](unsigned samples, auto force_N) {
        const Tared tared = tare(samples, 0, force_N);
        EXPECT_EQ(tared.end, Sensor::Tare::moved) << samples;
        EXPECT_EQ(tared.after.force_S_N[2], -3);
        EXPECT_EQ(tared.after.tare_count, 0u);
    };
    for (const unsigned n : {8u, 10u, 100u}) {
        moves(n, [n](unsigned i) { return 0.1 * i / n; });                           // 0.1 N in 0.1 s
        moves(n, [n](unsigned i) { return i * 2 > n ? -0.1 : 0.0; });                // a touch
        moves(n, [n](unsigned i) { return i * 4 > n && i * 4 < 3 * n ? 0.1 : 0; });  // and its end
    }
}

TEST(Tare, OfWhatMovesByLessThanItsStandardDeviationIsDone) {
    const Tared tared = tare(100, 0, [](unsigned i) { return 5 + 2 * Through::kSd_N * i / 100; });
    EXPECT_EQ(tared.end, Sensor::Tare::done);
    EXPECT_NEAR(tared.after.force_S_N[2], -8, 2 * Through::kSd_N);
}

TEST(Tare, NoiseOfManyTimesTheStatedStandardDeviationIsNoMotion) {
    std::mt19937 random(3);
    std::normal_distribution<double> noise(0, 10 * Through::kSd_N);
    int refused = 0;
    for (int i = 0; i < 20'000; ++i)
        refused += tare(100, 0, [&](unsigned) { return noise(random); }).end == Sensor::Tare::done ? 0 : 1;
    EXPECT_LE(refused, 2) << "one in ten thousand";
}

TEST(Tare, OfAModelWithoutAStandardDeviationIsJudgedByTheNoise) {
    TareWindow still, moving;
    const Wrench unknown{NAN, NAN, NAN, NAN, NAN, NAN};
    std::mt19937 random(4);
    std::normal_distribution<double> noise(0, 0.1);
    for (TareWindow* window : {&still, &moving}) window->begin(0, 100);
    for (unsigned i = 0; i <= 100; ++i) {
        const double n = noise(random);
        (void)still.add({NAN, 0, n, 0, 0, 0}, i);
        (void)moving.add({NAN, 0, n + 0.02 * i, 0, 0, 0}, i);
    }
    EXPECT_FALSE(still.has_moved(unknown));
    EXPECT_TRUE(moving.has_moved(unknown));
}

TEST(Tare, OfASlowSensorWaitsForEightSamplesAndSeesItsMotion) {
    const Wrench sd{0.1, 0.1, 0.1, NAN, NAN, NAN};
    TareWindow still, moving, stepping;
    for (TareWindow* window : {&still, &moving, &stepping}) window->begin(0, 100);
    for (unsigned i = 0; i < 8; ++i) {
        EXPECT_EQ(still.add({0, 0, 0, 0, 0, 0}, 40 + 500 * i), i == 7) << i;
        (void)moving.add({0, 0, 0.5 * i, 0, 0, 0}, 40 + 500 * i);
        (void)stepping.add({0, 0, i < 4 ? 0.0 : -15.0, 0, 0, 0}, 40 + 500 * i);
    }
    EXPECT_FALSE(still.has_moved(sd));
    EXPECT_TRUE(moving.has_moved(sd));
    EXPECT_TRUE(stepping.has_moved(sd));
}

TEST(Tare, BeyondTheLimitIsRefusedAsALoadAndWithoutALimitTaken) {
    const auto at_rest = [](double force_N) { return [force_N](unsigned) { return force_N; }; };
    EXPECT_EQ(tare(100, 2, at_rest(-2.01)).end, Sensor::Tare::loaded);
    EXPECT_EQ(tare(100, 2, at_rest(-2.01)).after.force_S_N[2], -3);
    EXPECT_EQ(tare(100, 2, at_rest(-1.99)).end, Sensor::Tare::done);
    EXPECT_NEAR(tare(100, 2, at_rest(-1.99)).after.force_S_N[2], -1.01, 1e-9);
    EXPECT_EQ(tare(100, 0, at_rest(-200)).end, Sensor::Tare::done);
}

TEST(Tare, BeyondTheLimitOfOneComponentIsRefusedToo) {
    const auto tare_of_z = [](double force_N, double limit_N) {
        Tuning tuning;
        tuning.tare_ms = 1;
        tuning.tare_limit_of_component_N = {0, 5, limit_N};
        Zero zero(tuning);
        zero.begin_tare(0);
        for (std::uint64_t i = 0; i <= 8; ++i) {
            tactiled_sample s{};
            s.quality = TACTILED_GOOD;
            s.t_ns = i * kMs;
            s.raw_force_S_N[0] = 100;  // a component without a limit
            s.raw_force_S_N[2] = force_N;
            if (zero.tare() == Sensor::Tare::running) (void)zero.advance(s, {}, 0, 1);
        }
        return zero.tare();
    };
    EXPECT_EQ(tare_of_z(-1.99, 2), Sensor::Tare::done);
    EXPECT_EQ(tare_of_z(-2.01, 2), Sensor::Tare::loaded);
    EXPECT_EQ(tare_of_z(2.01, 2), Sensor::Tare::loaded);
    EXPECT_EQ(tare_of_z(-200, 0), Sensor::Tare::done);
}

}  // namespace
}  // namespace tactiled
