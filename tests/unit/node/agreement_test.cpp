// Two sensors of one force.
#include "node/agreement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "node/sensor.hpp"
#include "tests/unit/milliseconds.hpp"
#include "through.hpp"

namespace tactiled {
namespace {

tactiled_sample at(std::uint64_t ms, double fz_N, double fx_N = 0) {
    tactiled_sample s{};
    s.t_ns = ms * kMs;
    s.quality = TACTILED_GOOD;
    s.force_S_N[0] = fx_N;
    s.force_S_N[1] = kNaN;
    s.force_S_N[2] = fz_N;
    return s;
}

// With sensor 1.
struct Pair : PairSettings, Agreement {
    Pair(double max_N, int patience_ms)
        : PairSettings{1, max_N, patience_ms}, Agreement(static_cast<PairSettings&>(*this)) {}
};

TEST(Agreement, IsOverAfterItsTimeAndBackAfterAsLong) {
    Pair pair(1, 10);
    for (std::uint64_t ms = 1; ms <= 10; ++ms) EXPECT_FALSE(pair.compare(at(ms, -5), at(ms, -7)));
    for (std::uint64_t ms = 11; ms <= 20; ++ms) EXPECT_TRUE(pair.compare(at(ms, -5), at(ms, -7)));
    for (std::uint64_t ms = 21; ms <= 30; ++ms) EXPECT_TRUE(pair.compare(at(ms, -5), at(ms, -5.5)));
    EXPECT_FALSE(pair.compare(at(31, -5), at(31, -5.5)));
}

TEST(Agreement, AShortDifferenceIsNone) {
    Pair pair(1, 10);
    for (std::uint64_t ms = 1; ms < 500; ++ms) EXPECT_FALSE(pair.compare(at(ms, -5), at(ms, ms % 10 == 0 ? -5 : -9)));
}

TEST(Agreement, IsOfWhatBothSee) {
    Pair pair(1, 10);
    for (std::uint64_t ms = 1; ms < 50; ++ms) EXPECT_FALSE(pair.compare(at(ms, -5, 30), at(ms, -5, kNaN)));
    for (std::uint64_t ms = 50; ms < 60; ++ms) (void)pair.compare(at(ms, -5, 0.8), at(ms, -5.8, 0));
    EXPECT_TRUE(pair.compare(at(60, -5, 0.8), at(60, -5.8, 0)));  // the magnitude: 1.13 N
}

TEST(Agreement, AValueWithADoubtOfItsOwnProvesNothing) {
    Pair pair(1, 10);
    tactiled_sample silent = at(1, kNaN), railed = at(1, -80);
    silent.quality = TACTILED_BAD;
    silent.reasons = TACTILED_STALE;
    railed.quality = TACTILED_UNCERTAIN;
    railed.reasons = TACTILED_SATURATED;
    for (std::uint64_t ms = 1; ms < 50; ++ms) {
        EXPECT_FALSE(pair.compare(at(ms, -5), silent));
        EXPECT_FALSE(pair.compare(at(ms, -5), railed));
    }
    for (std::uint64_t ms = 50; ms <= 60; ++ms) (void)pair.compare(at(ms, -5), at(ms, -9));
    for (std::uint64_t ms = 61; ms < 100; ++ms) EXPECT_TRUE(pair.compare(at(ms, -5), silent));  // one of them was wrong
    EXPECT_TRUE(pair.compare(at(100, -5), railed)) << "a force that is too large for one tells nothing of the other";
    tactiled_sample frozen = at(101, -9);
    frozen.quality = TACTILED_BAD;
    frozen.reasons = TACTILED_FROZEN;
    for (std::uint64_t ms = 101; ms < 111; ++ms) EXPECT_TRUE(pair.compare(at(ms, -5), frozen));
    EXPECT_FALSE(pair.compare(at(111, -5), frozen)) << "that one";
    EXPECT_FALSE(pair.compare(at(112, -5), at(112, -9)));
}

TEST(Agreement, TheTimesOnBothSidesOfAGapAreNotAdded) {
    Pair pair(1, 10);
    tactiled_sample silent = at(1, kNaN);
    silent.quality = TACTILED_BAD;
    for (std::uint64_t ms = 1; ms <= 11; ++ms) (void)pair.compare(at(ms, -5), at(ms, -9));
    EXPECT_TRUE(pair.compare(at(12, -5), at(12, -5)));  // agree by chance
    for (std::uint64_t ms = 13; ms < 100; ++ms) EXPECT_TRUE(pair.compare(at(ms, -5), silent));
    EXPECT_TRUE(pair.compare(at(100, -5), at(100, -5))) << "the second sample that agrees is no agreement for 10 ms";
}

TEST(Agreement, ADoubtfulSampleNowAndThenDoesNotBeginTheTimeAnew) {
    Pair pair(1, 10);
    for (std::uint64_t ms = 1; ms <= 12; ++ms) {
        tactiled_sample mine = at(ms, -5);
        if (ms % 3 == 0) {
            mine.quality = TACTILED_UNCERTAIN;
            mine.reasons = TACTILED_STEPPED;
        }
        (void)pair.compare(mine, at(ms, -9));
    }
    EXPECT_TRUE(pair.differs());
}

TEST(Agreement, IsNotWithASampleOfAnotherTime) {
    Pair pair(1, 10);
    for (std::uint64_t ms = 100; ms < 200; ++ms) EXPECT_FALSE(pair.compare(at(ms, -double(ms)), at(89, -89)));
    for (std::uint64_t ms = 200; ms <= 210; ++ms) (void)pair.compare(at(ms, -5), at(ms - 9, -9));
    EXPECT_TRUE(pair.compare(at(211, -5), at(202, -9)));
    EXPECT_TRUE(pair.compare(at(1, -5), at(1, -5))) << "a time that goes back begins anew";
}

TEST(Agreement, ASensorInDoubtKeepsItsLowPass) {
    Sensor::Setup setup;
    setup.channel_of_frame = {0, 1, 2};
    setup.frame_channels = 3;
    setup.tuning.filter_hz = 5;
    setup.tuning.pair = {1, 1, 10};
    setup.decoupler = std::make_unique<Through>(INFINITY, kNaN);
    Sensor sensor(std::move(setup));
    sensor.start(7, 0);
    for (unsigned ms = 1; ms <= 1000; ++ms) {
        Frame f;
        f.t_ns = ms * kMs;
        f.n_channels = 3;
        f.channel = {0, 0, ms % 2 == 0 ? -4.0 : -6.0};
        (void)sensor.sample(f, f.t_ns);
        const tactiled_sample& compared = sensor.compare(at(ms, -50));
        EXPECT_EQ(compared.quality, ms <= 10 ? TACTILED_GOOD : TACTILED_UNCERTAIN) << ms;
        EXPECT_NEAR(compared.force_S_N[2], -5, ms > 500 ? 0.1 : 2);
    }
}

TEST(Agreement, OtherLimitsAndAReplacedSensorKeepTheDoubtUntilTheyAgree) {
    Pair pair(1, 10);
    for (std::uint64_t ms = 1; ms <= 11; ++ms) (void)pair.compare(at(ms, -5), at(ms, -7));
    EXPECT_TRUE(pair.compare(at(12, -5), at(12, -7)));
    pair.agree_N = 3;
    Pair successor(3, 10), of_another(3, 10);
    static_cast<PairSettings&>(of_another).other = 2;
    successor.succeed(pair);
    of_another.succeed(pair);
    for (std::uint64_t ms = 13; ms < 23; ++ms) {
        EXPECT_TRUE(pair.compare(at(ms, -5), at(ms, -7)));
        EXPECT_TRUE(successor.compare(at(ms, -5), at(ms, -7)));
        EXPECT_FALSE(of_another.compare(at(ms, -5), at(ms, -7)));
    }
    EXPECT_FALSE(pair.compare(at(23, -5), at(23, -7)));
    EXPECT_FALSE(successor.compare(at(23, -5), at(23, -7)));
}

}  // namespace
}  // namespace tactiled
