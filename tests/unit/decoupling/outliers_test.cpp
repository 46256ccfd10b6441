// Labels that look wrong: mistyped and swapped ones are named, nonlinear sensors lose nothing.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <utility>

#include "decoupling/fit/fit.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

TEST(Outliers, FourMistypedLoadsAmong120AreNamedAndLeftOut) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        Labelled labelled = Cell(seed).recording(1, 4, 0, 1e-4);
        ASSERT_EQ(labelled.rows.size(), 120u);
        // Errors: a sign, a decimal point, two swapped digits, the previous load; of loads in the middle of the
        // range.
        std::set<std::int64_t> wrong;
        const auto mistype = [&](std::size_t row, std::size_t axis, double label) {
            labelled.rows[row].wrench_S[axis] = label;
            wrong.insert(labelled.rows[row].line);
        };
        mistype(3, 0, 30);     // N, is -30
        mistype(44, 1, 4);     // is 40
        mistype(82, 2, -402);  // is -40
        mistype(97, 0, 10);    // is 30
        const FitReport report = fit(labelled, by("matrix"));
        EXPECT_EQ(lines_of(report, true), wrong) << seed;
        EXPECT_EQ(report.calibration.rows, 120 - int(wrong.size()));
        EXPECT_LT(percent_of_full_scale(report), 0.1) << seed;
        for (const std::int64_t line : wrong) EXPECT_TRUE(warns(report, "left out: cell.csv:" + std::to_string(line) + ":"));
        FitRequest keep = by("matrix");
        keep.keep_outliers = true;
        const FitReport kept = fit(labelled, keep);
        EXPECT_EQ(kept.calibration.rows, 120);
        EXPECT_TRUE(lines_of(kept, true).empty());
        EXPECT_FALSE(lines_of(kept).empty());
    }
}

TEST(Outliers, GoodRecordingsLoseNothing) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        const FitReport report = fit(Cell(seed).recording(1, 4, 0, 1e-3), by("matrix"));
        EXPECT_TRUE(report.suspects.empty()) << seed;
    }
}

// A load beyond all others, or at their end, may be one that the sensor reads too low: it is kept, and the user is
// asked to record it again.
TEST(Outliers, TheMostLoadedRowIsNeverLeftOut) {
    for (const double reads : {1.0, 1.2, 1.5}) {
        Labelled labelled = Cell(3).recording(1, 4, 0, 1e-4);
        LabelledRow row = labelled.rows[25];  // the greatest press, 100 N
        for (std::size_t i = 0; i < 3; ++i) row.channel[i] *= reads, row.wrench_S[i] *= 1.8;
        row.line = 122;
        labelled.rows.push_back(row);
        const FitReport report = fit(labelled, by("matrix"));
        EXPECT_EQ(report.calibration.rows, 121) << reads;
        EXPECT_EQ(lines_of(report), (std::set<std::int64_t>{122})) << reads;
        EXPECT_TRUE(warns(report, "kept: cell.csv:122: fz_N is -180")) << reads;
        EXPECT_TRUE(warns(report, "apply this load again")) << reads;
    }
}

// Weights of which the largest occurs once: a label in the range of the others cannot be explained by a nonlinearity.
TEST(Outliers, AMistypedGreatestLoadIsLeftOut) {
    Labelled labelled = Cell(4).recording(1, 4, 0, 1e-4);
    LabelledRow row = labelled.rows[25];
    for (double& reading : row.channel) reading *= 1.1;
    row.wrench_S[2] = 11;  // N, is -110
    row.line = 122;
    labelled.rows.push_back(row);
    EXPECT_EQ(lines_of(fit(labelled, by("matrix")), true), (std::set<std::int64_t>{122}));
}

// Random loads on a sensor that saturates softly. The largest loads disagree with a straight line, all of them alike.
TEST(Outliers, ABendOfTheSensorIsNoFaultOfItsLabels) {
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::normal_distribution<double> noise(0, 1e-3);
    Labelled labelled;
    labelled.name = "soft.csv";
    labelled.channels = {"A", "B"};
    for (int i = 0; i < 2000; ++i) {
        const double press = 10 * std::pow(uniform(random), 3);  // N: few great ones
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {std::tanh(press / 6) + noise(random), std::tanh(press / 9) + noise(random)},
                                 .wrench_S = {kNaN, kNaN, -press, kNaN, kNaN, kNaN}});
    }
    for (const char* method : {"matrix", "quadratic", "rbf"}) {
        const FitReport report = fit(labelled, by(method));
        EXPECT_EQ(report.calibration.full_scale[0], fit(labelled, by("rbf")).calibration.full_scale[0]) << method;
        EXPECT_GE(report.calibration.rows, 1995) << method;
    }
}

// A range that the sensor reads far too low, for a fiftieth of the time: the rows before and after share the error.
TEST(Outliers, ASaturatedRangeIsNoFaultOfItsLabels) {
    std::mt19937_64 random(6);
    std::normal_distribution<double> noise(0, 2e-3);
    Labelled labelled;
    labelled.name = "peaks.csv";
    labelled.channels = {"A", "B", "C"};
    for (int i = 0; i < 12'000; ++i) {
        const double t = 0.01 * i, press = (1 + std::sin(t)) * (1 + 4 * std::exp(-50 * (1 - std::sin(t / 7)))),
                     fx = std::sin(0.7 * t);
        const double read = press < 4 ? press : 4 + 0.2 * (press - 4);  // N
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {read + noise(random), fx - 0.3 * read + noise(random), fx + noise(random)},
                                 .wrench_S = {fx + 2 * noise(random), kNaN, -press + 2 * noise(random), kNaN, kNaN, kNaN}});
    }
    const FitReport report = fit(labelled, by("matrix"));
    EXPECT_LE(lines_of(report, true).size(), 2u);
}

// Labels swapped on a curve that only the right method models.
TEST(Outliers, AreJudgedByTheMethodThatIsChosen) {
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> noise(0, 2e-3);
    Labelled labelled;
    labelled.name = "bowl.csv";
    labelled.channels = {"A", "B"};
    for (int i = 0; i < 600; ++i) {
        const double fx = uniform(random), fz = uniform(random);
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {fx + 0.3 * fz * fz + noise(random), fz + 0.3 * fx * fx + noise(random)},
                                 .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN}});
    }
    for (const std::size_t at : {40u, 250u, 470u}) std::swap(labelled.rows[at].wrench_S, labelled.rows[at + 77].wrench_S);
    const FitReport report = fit(labelled, by("rbf"));
    std::size_t named = 0;
    for (const std::int64_t line : {42, 119, 252, 329, 472, 549}) named += lines_of(report, true).count(line);
    EXPECT_EQ(named, 6u);
    EXPECT_LE(report.suspects.size(), 6u + 3u);  // 0.5 % of the others
}

// Sensors whose errors have a long tail: its far end looks like wrong labels, but no recording loses more than a few rows.
TEST(Outliers, ALongTailLosesFewRows) {
    std::size_t named = 0, out = 0;
    for (unsigned seed = 1; seed <= 10; ++seed) {
        std::mt19937_64 random(seed);
        std::uniform_real_distribution<double> uniform(-1, 1);
        std::normal_distribution<double> noise(0, 1e-2);
        std::student_t_distribution<double> tail(2);
        Labelled labelled;
        labelled.name = "tail.csv";
        labelled.channels = {"A", "B", "C"};
        for (int i = 0; i < 3000; ++i) {
            const double fx = uniform(random), fz = uniform(random), e = 0.02 * tail(random);
            labelled.rows.push_back(
                {.line = i + 2,
                 .channel = {fx + noise(random) + e, fz + noise(random) - e, fx - fz + noise(random) + e},
                 .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN}});
        }
        const FitReport report = fit(labelled, by("matrix"));
        named += report.suspects.size();
        out += lines_of(report, true).size();
    }
    EXPECT_GT(named, 10u);
    EXPECT_LT(out, 30u);  // one in a thousand
}

// Labels off by 11 sd are within what a tail could reach, but the fit without them is better on rows left out.
TEST(Outliers, LabelsThatDistortTheFitAreLeftOut) {
    std::size_t out = 0;
    for (unsigned seed = 1; seed <= 10; ++seed) {
        Labelled labelled = Cell(seed).recording(1, 4, 0, 1e-2);
        for (const std::size_t i : {14u, 47u, 72u, 101u, 113u}) labelled.rows[i].wrench_S[0] += 5.5;  // N, 0 before
        out += lines_of(fit(labelled, by("matrix")), true).size();
    }
    EXPECT_GE(out, 25u);  // the others of 50 are named
}

// Labels off by 18 sd: no tail of good rows reaches so far, whether or not the fit without them is better.
TEST(Outliers, LabelsThatAreFarOffAreLeftOut) {
    std::size_t out = 0;
    for (unsigned seed = 1; seed <= 10; ++seed) {
        Labelled labelled = Cell(seed).recording(1, 4, 0, 1e-2);
        for (const std::size_t i : {14u, 72u, 113u}) labelled.rows[i].wrench_S[0] += i == 72 ? -9 : 9;  // N, 0 before
        out += lines_of(fit(labelled, by("matrix")), true).size();
    }
    EXPECT_GE(out, 29u);  // one of 30 is off by little more than the tail
}

// The labels of a scale that shows steps of 2 % of full scale are off by half a step at most.
TEST(Outliers, RoundedLabelsAreNoMistakes) {
    Labelled labelled = waves(1000, 3e-3, 1, false);
    for (std::size_t i = 0; i < 1000; ++i) {
        LabelledRow& row = labelled.rows[i];
        const double press = std::max(0.0, std::sin(double(i) / 7)), fx = 0.3 * press * std::sin(1e3 * double(i)),
                     fz = -press;
        const double noise = 0.2 * (row.channel[0] - row.wrench_S[0]);
        row.channel = {fx + 0.1 * fz + noise, fz + 0.05 * fx - noise, 0.5 * fx - fz};
        row.wrench_S[0] = 0.02 * std::round(fx / 0.02), row.wrench_S[2] = 0.02 * std::round(fz / 0.02);
    }
    EXPECT_TRUE(fit(labelled, by("matrix")).suspects.empty());
}

// A weight that rested on something: its error is less than half of the smallest step of the weights.
TEST(Outliers, WeightsAreNotRoundedLabels) {
    Labelled labelled = Cell(5).recording(1, 4, 0, 1e-4);
    for (auto& each : labelled.rows)
        for (std::size_t c = 0; c < 3; ++c) each.wrench_S[c] = 10 * std::round(each.wrench_S[c] / 10);
    LabelledRow& row = labelled.rows[82];
    ASSERT_EQ(row.wrench_S[2], -40);
    for (double& channel : row.channel) channel *= 0.9;
    EXPECT_EQ(lines_of(fit(labelled, by("matrix"))), (std::set<std::int64_t>{row.line}));
}

// A mistyped load that is kept, because it is at the end of the range, does not hide another one.
TEST(Outliers, AKeptLoadDoesNotHideOthers) {
    for (const double greatest : {70.0, 82.0, 90.0}) {
        Labelled labelled = Cell(7).recording(1, 4, 0, 1e-4);
        labelled.rows[45].wrench_S[1] = greatest;  // N, is 50, the greatest one
        labelled.rows[62].wrench_S[1] = -23;       // is 0
        const FitReport report = fit(labelled, by("matrix"));
        EXPECT_EQ(lines_of(report), (std::set<std::int64_t>{47, 64})) << greatest;
        EXPECT_EQ(lines_of(report, true), (std::set<std::int64_t>{64})) << greatest;
    }
}

// The label of a hold is wrong in each of its rows, which differ by the noise of the reference.
TEST(Outliers, AWrongHoldIsLeftOut) {
    for (const int rows : {2, 5, 10, 20}) {
        Labelled labelled;
        const Labelled loads = Cell(8).recording(1, 4, 0, 1e-4);
        labelled.name = loads.name, labelled.channels = loads.channels;
        std::mt19937_64 random(1);
        std::normal_distribution<double> noise(0, 1);
        std::set<std::int64_t> wrong;
        for (std::size_t l = 0; l < loads.rows.size(); ++l)
            for (int i = 0; i < rows; ++i) {
                LabelledRow row = loads.rows[l];
                row.line = std::int64_t(labelled.rows.size()) + 2;
                for (double& reading : row.channel) reading += 1e-4 * noise(random);
                for (std::size_t c = 0; c < 3; ++c) row.wrench_S[c] += 0.01 * noise(random);  // N
                if (l == 44) row.wrench_S[1] *= -1, wrong.insert(row.line);
                labelled.rows.push_back(row);
            }
        EXPECT_EQ(lines_of(fit(labelled, by("matrix")), true), wrong) << rows;
    }
}

TEST(Outliers, WhereManyDisagreeAllStay) {
    Labelled labelled = Cell(6).recording(1, 4, 0, 1e-4);
    for (std::size_t i = 3; i < 120; i += 10) labelled.rows[i].wrench_S[0] += 20;  // N; 12 of 120
    const FitReport report = fit(labelled, by("matrix"));
    EXPECT_EQ(report.calibration.rows, 120);
    EXPECT_TRUE(lines_of(report, true).empty());
}

}  // namespace
}  // namespace tactiled
