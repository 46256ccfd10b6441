#include <gtest/gtest.h>

#include <cmath>

#include "node/lab/tradeoff.hpp"

namespace tactiled::ctl {
namespace {

// Returns fz = channel 0, with the quality in channel 1.
class Says final : public Decoupler {
public:
    Estimate decouple(const Reading& reading) noexcept override {
        Estimate e;
        const int quality = int(reading.channel[1]);
        if (quality == TACTILED_BAD) return e;
        e.has_value = true;
        if (quality == TACTILED_UNCERTAIN) e.reasons = TACTILED_OUTSIDE_DOMAIN;
        e.wrench_S[2] = reading.channel[0];
        e.sd[2] = 0.01;
        return e;
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "says"; }
};

Candidate candidate() {
    Candidate c{"generic", "says", "says", {}};
    c.calibration.channels = {"a", "quality"};
    c.calibration.components = {"fz"};
    c.calibration.full_scale = {2};
    return c;
}

struct Row {
    double applied_N, read_N;
    tactiled_quality quality;
};
Labelled labelled(const std::vector<Row>& rows) {
    Labelled result{.name = "made", .channels = {"quality", "a"}, .sessions = {}, .rows = {}};
    for (const Row& row : rows)
        result.rows.push_back({.line = 1,
                               .channel = {double(row.quality), row.read_N},
                               .wrench_S = {kNaN, kNaN, row.applied_N, kNaN, kNaN, kNaN},
                               .session = 0,
                               .t_ns = 1});
    return result;
}
Judged judged(const std::vector<Row>& rows) {
    Says says;
    return judge(says, candidate(), labelled(rows));
}

TEST(Judge, CountsErrorsInPercentOfFullScaleAndLeavesOutWhatIsBad) {
    const Judged j = judged({{-1, -1.02, TACTILED_GOOD}, {-1, -0.94, TACTILED_UNCERTAIN}, {-1, -1, TACTILED_BAD}});
    EXPECT_NEAR(j.rms_percent[2], std::sqrt((1 + 9) / 2.0), 1e-9);  // errors 0.02 and 0.06 of 2 N
    EXPECT_NEAR(j.force_rms_percent, j.rms_percent[2], 1e-12);
    EXPECT_NEAR(j.good_rms_percent, 1, 1e-9);
    EXPECT_TRUE(std::isnan(j.rms_percent[0]));
    EXPECT_EQ(j.samples, 3u);
    EXPECT_EQ(j.good, 1u);
    EXPECT_EQ(j.uncertain, 1u);
    EXPECT_EQ(j.bad, 1u);
}

TEST(Judge, CallsGoodAndFarOffUndetected) {
    EXPECT_EQ(judged({{-1, -1.04, TACTILED_GOOD}}).undetected, 0u);       // 4 sd
    EXPECT_EQ(judged({{-1, -1.06, TACTILED_GOOD}}).undetected, 1u);       // 6 sd
    EXPECT_EQ(judged({{-1, -1.06, TACTILED_UNCERTAIN}}).undetected, 0u);  // it was marked
}

TEST(Judge, TaresOnTheSecondHalfOfTheRestAndJudgesFromTheFirstLoadOn) {
    const Judged j = judged({{0, 9, TACTILED_GOOD},  // it had just been switched on
                             {0, 9, TACTILED_GOOD},
                             {0, 0.3, TACTILED_GOOD},
                             {0, 0.1, TACTILED_GOOD},
                             {-1, -0.8, TACTILED_GOOD},
                             {0, 0.2, TACTILED_GOOD}});
    EXPECT_EQ(j.samples, 2u);
    EXPECT_NEAR(j.force_rms_percent, 0, 1e-9);
}

TEST(Judge, AMethodThatIsBadInOneSceneHasNoErrorOverAll) {
    const Judged easy = judged({{-1, -1.02, TACTILED_GOOD}, {-1, -1.02, TACTILED_BAD}});
    const Judged hard = judged({{-1, -1.08, TACTILED_GOOD}});
    const Judged blind = judged({{-1, -9, TACTILED_BAD}, {-1, -9, TACTILED_BAD}});
    EXPECT_NEAR(over_all({easy, hard}).force_rms_percent, 2, 1e-9);  // from 1 and 4 % of 2 N
    EXPECT_EQ(over_all({easy, hard}).bad, 1u);
    const Judged all = over_all({easy, blind});
    EXPECT_TRUE(std::isnan(all.force_rms_percent));
    EXPECT_TRUE(std::isnan(all.rms_percent[2]));
    EXPECT_TRUE(std::isnan(all.p99_percent[2]));
    EXPECT_EQ(all.bad, 3u);
    EXPECT_EQ(all.samples, 4u);
}

TEST(Judge, TakesChannelsByNameAndSaysWhichIsMissing) {
    Labelled rows = labelled({{-1, -1, TACTILED_GOOD}});
    rows.channels = {"quality", "b"};
    Says says;
    try {
        (void)judge(says, candidate(), rows);
        FAIL();
    } catch (const SetupError& error) { EXPECT_NE(std::string(error.what()).find("\"a\""), std::string::npos); }
}

}  // namespace
}  // namespace tactiled::ctl
