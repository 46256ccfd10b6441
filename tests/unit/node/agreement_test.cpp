// Two sensors of one force.
#include "node/agreement.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace tactiled {
namespace {

constexpr std::uint64_t kMs = 1'000'000;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

tactiled_sample at(std::uint64_t ms, double fz_N, double fx_N = 0) {
    tactiled_sample s{};
    s.t_ns = ms * kMs;
    s.quality = TACTILED_GOOD;
    s.force_S_N[0] = fx_N;
    s.force_S_N[1] = kNaN;
    s.force_S_N[2] = fz_N;
    return s;
}

Agreement within(double most_N, std::uint64_t patience_ms) { return Agreement({1, most_N, patience_ms * kMs}); }

TEST(Agreement, IsOverAfterItsTimeAndBackAfterAsLong) {
    Agreement pair = within(1, 10);
    for (std::uint64_t ms = 1; ms <= 10; ++ms) EXPECT_FALSE(pair.differs(at(ms, -5), at(ms, -7)));
    for (std::uint64_t ms = 11; ms <= 20; ++ms) EXPECT_TRUE(pair.differs(at(ms, -5), at(ms, -7)));
    for (std::uint64_t ms = 21; ms <= 30; ++ms) EXPECT_TRUE(pair.differs(at(ms, -5), at(ms, -5.5)));
    EXPECT_FALSE(pair.differs(at(31, -5), at(31, -5.5)));
}

TEST(Agreement, AShortDifferenceIsNone) {
    Agreement pair = within(1, 10);
    for (std::uint64_t ms = 1; ms < 500; ++ms) EXPECT_FALSE(pair.differs(at(ms, -5), at(ms, ms % 10 == 0 ? -5 : -9)));
}

TEST(Agreement, IsOfWhatBothSee) {
    Agreement pair = within(1, 10);
    for (std::uint64_t ms = 1; ms < 50; ++ms) EXPECT_FALSE(pair.differs(at(ms, -5, 30), at(ms, -5, kNaN)));
    for (std::uint64_t ms = 50; ms < 60; ++ms) (void)pair.differs(at(ms, -5, 0.8), at(ms, -5.8, 0));
    EXPECT_TRUE(pair.differs(at(60, -5, 0.8), at(60, -5.8, 0)));  // the magnitude: 1.13 N
}

TEST(Agreement, AValueWithADoubtOfItsOwnProvesNothing) {
    Agreement pair = within(1, 10);
    tactiled_sample silent = at(1, kNaN), railed = at(1, -80);
    silent.quality = TACTILED_BAD;
    silent.reasons = TACTILED_STALE;
    railed.quality = TACTILED_UNCERTAIN;
    railed.reasons = TACTILED_SATURATED;
    for (std::uint64_t ms = 1; ms < 50; ++ms) {
        EXPECT_FALSE(pair.differs(at(ms, -5), silent));
        EXPECT_FALSE(pair.differs(at(ms, -5), railed));
    }
    for (std::uint64_t ms = 50; ms <= 60; ++ms) (void)pair.differs(at(ms, -5), at(ms, -9));
    for (std::uint64_t ms = 61; ms < 100; ++ms) EXPECT_TRUE(pair.differs(at(ms, -5), silent));  // one of them was wrong
    EXPECT_FALSE(pair.differs(at(100, -5), railed));                                            // that one
    EXPECT_FALSE(pair.differs(at(101, -5), at(101, -9)));
}

TEST(Agreement, OtherLimitsBeginAnewAndTheSameOnesDoNot) {
    Agreement pair = within(1, 10);
    for (std::uint64_t ms = 1; ms <= 11; ++ms) (void)pair.differs(at(ms, -5), at(ms, -7));
    pair.judge_by({1, 1, 10 * kMs});
    EXPECT_TRUE(pair.differs(at(12, -5), at(12, -7)));
    pair.judge_by({1, 3, 10 * kMs});
    EXPECT_FALSE(pair.differs(at(13, -5), at(13, -7)));
}

}  // namespace
}  // namespace tactiled
