// Labelled rows that a fit leaves out, refuses or reports.
#include <gtest/gtest.h>

#include <cmath>

#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

TEST(Input, RowsAtSaturationLimitsStayOut) {
    Labelled labelled = waves(300, 3e-3, 1, false);
    for (std::size_t i = 0; i < 12; ++i) labelled.rows[20 * i].channel[1] = i % 2 == 0 ? 3.3 : -3.3;
    FitRequest request = by("matrix");
    request.saturates_above = 3.3;
    request.saturates_below = -3.3;
    const FitReport report = fit(labelled, request);
    EXPECT_EQ(report.rows_saturated, 12);
    EXPECT_EQ(report.calibration.rows, 288);
    EXPECT_LT(report.calibration.channel_most[1], 1.1);
    request.saturates_above = -3.3;
    EXPECT_NE(refusal(labelled, request).find("at a saturation limit"), std::string::npos);
}

TEST(Input, OddLabelsAndReadingsAreNamed) {
    Labelled labelled = waves(300, 3e-3, 1, false);
    EXPECT_FALSE(warns(fit(labelled, by("matrix")), "fz_N is never negative"));
    Labelled positive = labelled;
    for (auto& row : positive.rows) row.wrench_S[2] += 1.001;
    EXPECT_TRUE(warns(fit(positive, by("matrix")), "fz_N is never negative"));
    Labelled tiny = labelled, huge = labelled, far = labelled;
    for (auto& row : tiny.rows) row.wrench_S[0] *= 1e-300;
    EXPECT_NE(refusal(tiny, by("matrix")).find("e-301 at most, which no reference measures"), std::string::npos)
        << refusal(tiny, by("matrix"));
    huge.rows[7].channel[1] = 1e170;
    EXPECT_NE(refusal(huge, by("matrix")).find("waves.csv:9: channel B is 1e+170"), std::string::npos)
        << refusal(huge, by("matrix"));
    far.rows[7].wrench_S[2] = 1e200;
    EXPECT_NE(refusal(far, by("matrix")).find("waves.csv:9: fz_N is 1e+200"), std::string::npos);
}

TEST(Input, TimesBeforeZeroKeepTheirDistances) {
    const ScratchFile file("t_s,A,fz_N\n-2.5,1,-1\n-1.25,2,-2\n0,3,-3\n1,4,-4\n");
    const Labelled labelled = read_labelled(file.path(), {});
    EXPECT_EQ(labelled.rows[1].t_ns - labelled.rows[0].t_ns, 1250000000u);
    EXPECT_EQ(labelled.rows[3].t_ns - labelled.rows[0].t_ns, 3500000000u);
    EXPECT_GT(labelled.rows[0].t_ns, 0u);
}

}  // namespace
}  // namespace tactiled
