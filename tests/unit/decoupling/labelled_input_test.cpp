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
    const ScratchFile file("t_s,A1,fz_N\n-2.5,1,-1\n-1.25,2,-2\n0,3,-3\n1,4,-4\n");
    const Labelled labelled = read_labelled(file.path(), {});
    EXPECT_EQ(labelled.rows[1].t_ns - labelled.rows[0].t_ns, 1250000000u);
    EXPECT_EQ(labelled.rows[3].t_ns - labelled.rows[0].t_ns, 3500000000u);
    EXPECT_GT(labelled.rows[0].t_ns, 0u);
}

// A recording whose loads move on from row to row.
Labelled walk(int rows) {
    Labelled labelled = waves(rows, 3e-3, 1, false);
    double fx = 0, fz = 0;
    for (auto& row : labelled.rows) {
        fx = 0.8 * fx + 0.2 * row.wrench_S[0], fz = 0.8 * fz + 0.2 * row.wrench_S[2];
        const double noise = row.channel[0] - row.wrench_S[0];
        row.wrench_S[0] = fx, row.wrench_S[2] = fz;
        row.channel = {fx + noise, fz - noise, 0.5 * fx - fz + noise};
    }
    return labelled;
}

TEST(Input, LabelsInAnotherUnitOrWithAnotherSignAreRefusedWithTheirSession) {
    for (const auto& [factor, remark] : {std::pair(101.97, "1 N is the weight of 102 g"),
                                         {-1.0, "the sign is the other one"},
                                         {0.10197, "0.102 kg"},
                                         {1 / 101.97, "102 g"},
                                         {1.3, ""},
                                         {1.0, ""}}) {
        Labelled labelled = walk(400);
        labelled.sessions = {"a", "b"};
        for (std::size_t i = 200; i < 400; ++i) labelled.rows[i].session = 1, labelled.rows[i].wrench_S[2] *= factor;
        const std::string text = refusal(labelled, by("matrix"));
        if (*remark == 0)
            EXPECT_EQ(text, "") << factor;
        else
            EXPECT_NE(text.find("fz_N of session \"b\" (from waves.csv:202 on)"), std::string::npos) << factor << text;
        EXPECT_NE(text.find(remark), std::string::npos) << factor << text;
    }
}

// Standardised readings beside raw ones, another gain; another zero is neither of these.
TEST(Input, SessionsThatContradictEachOtherAreNamed) {
    Labelled labelled = walk(400);
    labelled.sessions = {"a", "b"};
    for (std::size_t i = 200; i < 400; ++i) labelled.rows[i].session = 1;
    const auto changed = [&](auto change) {
        Labelled other = labelled;
        for (std::size_t i = 200; i < 400; ++i) change(other.rows[i].channel);
        return other;
    };
    const Labelled scaled = changed([](auto& channel) {
        for (double& x : channel) x = 500 * x + 20;
    });
    for (const char* text : {"sessions a and b contradict each other",
                             "of session \"b\" (from waves.csv:202 on) is 0.002 times that of the others",
                             "Calibrate sessions that agree, for example --session a or --session b"})
        EXPECT_NE(refusal(scaled, by("matrix")).find(text), std::string::npos) << refusal(scaled, by("matrix"));
    const Labelled twice = changed([](auto& channel) {
        for (double& x : channel) x *= 2;
    });
    EXPECT_TRUE(warns(fit(twice, by("matrix")), "is 0.5 times that of the others"));
    const Labelled moved = changed([](auto& channel) {
        for (double& x : channel) x += 3;
    });
    for (const Labelled& other : {labelled, moved}) EXPECT_FALSE(warns(fit(other, by("matrix")), "contradict"));
}

TEST(Input, LateLabelsAreNamedWithTheirDelay) {
    const Labelled labelled = walk(400);
    EXPECT_FALSE(warns(fit(labelled, by("matrix")), "fits the channels of"));
    Labelled late = labelled, early = labelled;
    for (std::size_t i = 3; i < 400; ++i) {
        late.rows[i].wrench_S = labelled.rows[i - 3].wrench_S;
        early.rows[i - 3].wrench_S = labelled.rows[i].wrench_S;
    }
    EXPECT_TRUE(warns(fit(late, by("matrix")), "fits the channels of 3 rows earlier"));
    EXPECT_TRUE(warns(fit(early, by("matrix")), "fits the channels of 3 rows later"));
}

TEST(Input, ChannelsThatAreNoReadingsAreNamed) {
    const Labelled labelled = walk(400);
    for (const char* text : {"rises in every row", "saturation limit?", "all labels are exactly 0"})
        EXPECT_FALSE(warns(fit(labelled, by("matrix")), text)) << text;
    Labelled counts = labelled, mark = labelled, cut = labelled, empty = labelled;
    counts.channels.emplace_back("n");
    for (std::size_t i = 0; i < 400; ++i) counts.rows[i].channel.push_back(double(i) + 0.1 * std::sin(double(i)));
    EXPECT_TRUE(warns(fit(counts, by("matrix")), "channel n rises in every row"));
    mark.rows[40].channel[1] = mark.rows[90].channel[1] = -999;
    EXPECT_NE(refusal(mark, by("matrix")).find("waves.csv:42: channel B is -999 there and in 1 other rows"),
              std::string::npos)
        << refusal(mark, by("matrix"));
    mark.rows[90].channel[1] = -998;  // two values are no mark
    EXPECT_EQ(refusal(mark, by("matrix")), "");
    for (auto& row : cut.rows) row.channel[2] = std::min(row.channel[2], 0.3);
    EXPECT_TRUE(warns(fit(cut, by("matrix")), "channel C is exactly 0.3, its greatest value"));
    for (std::size_t i = 0; i < 400; ++i)
        if (i % 3 != 0) empty.rows[i].wrench_S[0] = empty.rows[i].wrench_S[2] = 0;
    EXPECT_TRUE(warns(fit(empty, by("matrix")), "all labels are exactly 0 in 266 rows (first: line 3)"));
}

TEST(Input, LoadsThatOnlyRiseShowNoHysteresis) {
    Labelled up = waves(300, 3e-3, 1, false), down = up;
    const char* const text = "every load is applied upwards from nothing";
    EXPECT_FALSE(warns(fit(down, by("matrix")), text));
    for (std::size_t i = 0; i < 300; ++i) {
        const double level = double(i % 10) / 9, fx = i % 20 < 10 ? level : 0.0, fz = i % 20 < 10 ? 0.0 : -level;
        up.rows[i].wrench_S[0] = fx, up.rows[i].wrench_S[2] = fz;
        up.rows[i].channel = {fx + 1e-3 * std::sin(double(i)), fz, 0.5 * fx - fz + 1e-3 * std::cos(2.0 * double(i))};
    }
    EXPECT_TRUE(warns(fit(up, by("matrix")), text));
}

TEST(Input, MarksForMissingLabelsAreRefused) {
    Labelled labelled = walk(400);
    for (const double mark : {-999.0, 9999.0, 12345.0}) {
        Labelled marked = labelled;
        for (const std::size_t i : {40u, 90u, 130u}) marked.rows[i].wrench_S[2] = mark;
        EXPECT_NE(refusal(marked, by("matrix")).find("waves.csv:42: fz_N is"), std::string::npos)
            << refusal(marked, by("matrix"));
    }
    Labelled nines = labelled, mistyped = labelled, decades = labelled;
    nines.rows[40].wrench_S[2] = -999;
    EXPECT_NE(refusal(nines, by("matrix")).find("-999 there and in 0 other rows"), std::string::npos);
    mistyped.rows[40].wrench_S[2] = -12;  // is -1.2: named, not refused
    EXPECT_EQ(refusal(mistyped, by("matrix")), "");
    Labelled far = labelled;  // the channels follow: a weight that is far above the others
    for (const std::size_t i : {40u, 90u}) {
        far.rows[i].wrench_S[2] = -99;
        far.rows[i].channel = {labelled.rows[i].channel[0], -98, 98};  // the same for both, as from a converter of few bits
    }
    EXPECT_EQ(refusal(far, by("matrix")), "");
    far.rows[90].channel = labelled.rows[90].channel;
    EXPECT_NE(refusal(far, by("matrix")).find("-99 there and in 1 other rows"), std::string::npos);
    for (const std::size_t i : {40u, 90u}) far.rows[i].channel = {labelled.rows[i].channel[0], -9800, 9800};
    EXPECT_NE(refusal(far, by("matrix")).find("a mark for a missing value"), std::string::npos);
    Labelled both = labelled;
    for (const std::size_t i : {40u, 90u}) both.rows[i].wrench_S[2] = both.rows[i].channel[1] = -999;
    EXPECT_NE(refusal(both, by("matrix")).find("fz_N is -999 there"), std::string::npos);
    Labelled dropped = labelled;  // the converter had no supply: no load explains both
    for (auto& row : dropped.rows) {
        for (double& channel : row.channel) channel += 50;
        row.channel.push_back(0);
    }
    dropped.channels.push_back("status");
    for (const std::size_t i : {40u, 90u}) {
        dropped.rows[i].wrench_S[2] = -999;
        dropped.rows[i].channel = {0, 0, 0, 1};
    }
    EXPECT_NE(refusal(dropped, by("matrix")).find("a mark for a missing value"), std::string::npos);
    for (std::size_t i = 0; i < 400; ++i) {  // weights of 0.1, 1 and 10 N, the last one twice
        const double fz = i == 100 || i == 200 ? -10 : i % 2 == 0 ? -1 : -0.1;
        decades.rows[i].wrench_S[2] = fz;
        decades.rows[i].channel[1] = fz + 1e-3 * std::sin(double(i));
    }
    EXPECT_EQ(refusal(decades, by("matrix")).find("a mark for a missing value"), std::string::npos);
}

TEST(Input, OtherUnitsOfLabelsAndTimesAreNamed) {
    Labelled labelled = walk(400), grams = labelled, long_arm = labelled, milliseconds = labelled;
    for (std::size_t i = 0; i < 400; ++i) {
        labelled.rows[i].t_ns = (i + 1) * 36'000'000;
        milliseconds.rows[i].t_ns = (i + 1) * 36'000'000'000;
        grams.rows[i].wrench_S[2] *= 1e4;
        long_arm.rows[i].wrench_S[3] = 5 * long_arm.rows[i].wrench_S[0] + labelled.rows[i].channel[1];
    }
    const FitReport plain = fit(labelled, by("matrix"));
    for (const char* text : {"grams or mN", "with an arm of", "in milliseconds?"}) EXPECT_FALSE(warns(plain, text)) << text;
    EXPECT_TRUE(warns(fit(grams, by("matrix")), "labels are in N; are these grams or mN?"));
    EXPECT_TRUE(warns(fit(long_arm, by("matrix")), "with an arm of"));
    EXPECT_TRUE(warns(fit(milliseconds, by("matrix")), "the rows are 36 s apart by t_s"));
    // Each session may begin at 0.
    Labelled again = labelled, shuffled = milliseconds;
    again.sessions = {"a", "b"};
    for (std::size_t i = 200; i < 400; ++i) again.rows[i].session = 1, again.rows[i].t_ns -= 200ull * 36'000'000;
    EXPECT_FALSE(warns(fit(again, by("matrix")), "t_s goes backwards"));
    for (std::size_t i = 10; i + 1 < 400; i += 2) std::swap(shuffled.rows[i].t_ns, shuffled.rows[i + 1].t_ns);
    EXPECT_TRUE(warns(fit(shuffled, by("matrix")), "t_s goes backwards at waves.csv:13 and in 194 rows after that"));
    EXPECT_FALSE(warns(fit(shuffled, by("matrix")), "in milliseconds?"));
}

TEST(Input, OneMistypedPullDoesNotHideThatAllArePresses) {
    Labelled labelled = walk(400);
    for (auto& row : labelled.rows) row.wrench_S[2] -= 1.001;
    labelled.rows[33].wrench_S[2] = 90;  // N
    EXPECT_FALSE(warns(fit(labelled, by("matrix")), "fz_N is never negative"));
}

TEST(Input, FewRowsAreRefusedBeforeTheirLabelsAreJudged) {
    Labelled two = waves(2, 3e-3, 1, false);
    for (auto& row : two.rows) row.wrench_S[0] = 0;
    EXPECT_EQ(refusal(two, by("matrix")),
              "2 rows with a label; at least 3 a coefficient are needed, 12 for 3 channels: record more");
}

}  // namespace
}  // namespace tactiled
