#include "node/progress.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "tests/unit/milliseconds.hpp"

namespace tactiled {
namespace {

TEST(Progress, WhoTurnsWithinItsLimitIsNotNamed) {
    Progress progress;
    Progress::Liveness loop(progress, "loop", 50 * kMs);
    for (std::uint64_t now_ns = kMs; now_ns < 1000 * kMs; now_ns += 40 * kMs) {
        loop.count();
        EXPECT_EQ(progress.look(now_ns), "");
    }
}

TEST(Progress, WhoStandsStillIsNamedAfterItsOwnLimitAndNoLongerWhenItGoesOn) {
    Progress progress;
    Progress::Liveness loop(progress, "loop", 50 * kMs), link(progress, "link", 300 * kMs);
    EXPECT_EQ(progress.look(1000 * kMs), "");
    loop.count();
    link.count();
    EXPECT_EQ(progress.look(1020 * kMs), "");
    EXPECT_EQ(progress.look(1070 * kMs), "");
    EXPECT_EQ(progress.look(1071 * kMs), "loop");
    loop.count();
    EXPECT_EQ(progress.look(1090 * kMs), "");
    loop.count();
    EXPECT_EQ(progress.look(1330 * kMs), "link");
}

TEST(Progress, WithTwoThatStandStillTheFirstIsNamed) {
    Progress progress;
    Progress::Liveness one(progress, "one", kMs), two(progress, "two", kMs);
    EXPECT_EQ(progress.look(kMs), "");
    EXPECT_EQ(progress.look(10 * kMs), "one");
}

TEST(Progress, AThreadThatHasEndedIsForgotten) {
    Progress progress;
    auto link = std::make_unique<Progress::Liveness>(progress, "link", kMs);
    EXPECT_EQ(progress.look(kMs), "");
    EXPECT_EQ(progress.look(10 * kMs), "link");
    link.reset();
    EXPECT_EQ(progress.look(20 * kMs), "");
}

TEST(Progress, NoLimitIsNeverReached) {
    Progress progress;
    Progress::Liveness link(progress, "link", UINT64_MAX);
    EXPECT_EQ(progress.look(1), "");
    EXPECT_EQ(progress.look(UINT64_MAX - 1), "");
}

}  // namespace
}  // namespace tactiled
