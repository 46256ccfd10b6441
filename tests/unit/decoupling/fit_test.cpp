#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

FitRequest generic() {
    return {.model = "generic", .method = "", .serial = "S1", .channel_unit = "V", .date = "2026-03-01"};
}
FitRequest table() {
    return {.model = "table", .method = "", .serial = "S1", .channel_unit = "dR/R0", .date = "2026-03-01"};
}

// Returns `rows` rows of random channels in -1 .. 1; `force` gives the labels.
Labelled random_rows(int rows, std::size_t channels, const std::function<Wrench(const std::vector<double>&)>& force,
                     unsigned seed = 1) {
    Labelled labelled;
    labelled.name = "made.csv";
    for (std::size_t k = 0; k < channels; ++k) labelled.channels.push_back("C" + std::to_string(k + 1));
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int i = 0; i < rows; ++i) {
        LabelledRow row{.line = i + 2, .channel = {}, .wrench_S = kUnseen, .session = 0};
        for (std::size_t k = 0; k < channels; ++k) row.channel.push_back(uniform(random));
        row.wrench_S = force(row.channel);
        labelled.rows.push_back(row);
    }
    return labelled;
}

Wrench only_fz(double fz) { return {kNaN, kNaN, fz, kNaN, kNaN, kNaN}; }

// Noise of the first channel is an error of fz and of my.
TEST(Fit, StatesTheCorrelationOfForceAndMoments) {
    auto labelled = random_rows(2000, 2, [](const std::vector<double>& r) {
        Wrench wrench = kUnseen;
        wrench[2] = r[0];
        wrench[4] = 3 * r[0] - 4 * r[1];
        return wrench;
    });
    std::mt19937_64 random(2);
    std::normal_distribution<double> noise(0, 0.01);
    for (LabelledRow& row : labelled.rows)
        for (double& channel : row.channel) channel += noise(random);
    Calibration calibration = fit(labelled, generic()).calibration;
    ASSERT_EQ(calibration.correlation.size(), 1u);
    EXPECT_NEAR(calibration.correlation[0], 0.6, 0.05);
    const std::vector<double> channel{0.5, 0.5};
    const auto decoupler = make_decoupler(calibration);
    const Correlations& correlations = *decoupler->decouple({.channel = channel}).correlations;
    EXPECT_EQ(correlations.between[Correlations::index(2, 4)], float(calibration.correlation[0]));
    Problems problems;
    EXPECT_EQ(parse_calibration(calibration_text(calibration), "c.toml", problems).correlation, calibration.correlation);
    calibration.correlation = {1, 0};
    DecouplerFault fault;
    EXPECT_EQ(make_decoupler(calibration, "", 0, fault), nullptr);
    EXPECT_NE(fault.text.find("correlation has 2 numbers"), std::string::npos) << fault.text;
}

// Offsets of 1e6 on channels of width 1 and gains of 1e-3 .. 1e3: the raw normal equations lose all digits here.
TEST(Fit, RecoversAKnownMatrixToRounding) {
    const double m[3][4] = {{1e3, -2, 0.5e-3, 7}, {0.25, 3e-3, 400, -1}, {-5, 6, 7, 8}};
    auto labelled = random_rows(400, 4, [&](const std::vector<double>& r) {
        Wrench wrench = kUnseen;
        for (std::size_t c = 0; c < 3; ++c) wrench[c] = m[c][0] * r[0] + m[c][1] * r[1] + m[c][2] * r[2] + m[c][3] * r[3];
        return wrench;
    });
    for (auto& row : labelled.rows)
        for (std::size_t k = 0; k < 4; ++k) row.channel[k] += 1e6;
    const FitReport report = fit(labelled, generic());
    const Calibration& c = report.calibration;
    EXPECT_LT(c.condition, 1.3);
    // A reading of 1e6 + r resolves r to 1.2e-10, so a coefficient is known to about that times the largest of its
    // row over the square root of the rows, times the condition number.
    const double rounding = 1.2e-10 * c.condition;
    const double greatest[3] = {1e3, 400, 8};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(c.matrix[i][k], m[i][k], rounding * greatest[i]) << i << k;
    for (const auto& component : report.components) EXPECT_LT(component.held_out_rms, 1e-9 * component.full_scale);
    EXPECT_EQ(c.components, (std::vector<std::string>{"fx", "fy", "fz"}));
    EXPECT_EQ(c.rows, 400);
}

TEST(Fit, FoldsTheConstantIntoTheZero) {
    const auto labelled =
        random_rows(60, 3, [](const std::vector<double>& r) { return only_fz(2 * r[0] - r[1] + 0.5 * r[2] - 0.75); });
    const Calibration c = fit(labelled, generic()).calibration;
    const auto decoupler = make_decoupler(c);
    EXPECT_NEAR(decouple(*decoupler, {0, 0, 0}).wrench_S[2], -0.75, 1e-14);
    EXPECT_NEAR(decouple(*decoupler, c.zero).wrench_S[2], 0, 0);
}

TEST(Fit, ZeroIsWhereTheChannelsRest) {
    // Three channels, one force: many zeros give the same force; the expected one is the reading at rest.
    std::mt19937_64 random(3);
    std::normal_distribution<double> noise(0, 0.01);
    Labelled labelled = random_rows(200, 3, [](const std::vector<double>& r) { return only_fz(r[0]); });
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        auto& row = labelled.rows[i];
        const double fz = i % 4 == 0 ? 0 : -10 * std::abs(row.channel[0]);
        row.channel = {5 + 2 * fz + noise(random), -7 + fz + noise(random), 100 - 3 * fz + noise(random)};
        row.wrench_S = only_fz(fz);
    }
    const FitReport report = fit(labelled, generic());
    EXPECT_NEAR(report.calibration.zero[0], 5, 0.02);
    EXPECT_NEAR(report.calibration.zero[1], -7, 0.02);
    EXPECT_NEAR(report.calibration.zero[2], 100, 0.02);
    EXPECT_FALSE(warns(report, "unloaded"));
    for (auto& row : labelled.rows) row.wrench_S[2] -= 20;  // never unloaded
    EXPECT_TRUE(warns(fit(labelled, generic()), "no row is unloaded"));
}

TEST(Fit, UsesRowsThatHaveALabelAndEveryChannel) {
    auto labelled = random_rows(100, 2, [](const std::vector<double>& r) { return only_fz(r[0] + r[1]); });
    for (std::size_t i = 0; i < 30; ++i) labelled.rows[i].wrench_S = kUnseen;
    for (std::size_t i = 30; i < 37; ++i) labelled.rows[i].channel[1] = kNaN;
    const FitReport report = fit(labelled, generic());
    EXPECT_EQ(report.rows_read, 100);
    EXPECT_EQ(report.rows_without_label, 30);
    EXPECT_EQ(report.rows_missing_channel, 7);
    EXPECT_EQ(report.calibration.rows, 63);
    EXPECT_TRUE(warns(report, "7 labelled rows lack a channel"));
}

// Every session has its own offset, as a skin has after each mounting, and the label is constant within half a
// session. Random rows would include every session's offset and give an error of 0.1 N; a new session really has
// about 1 N.
TEST(Fit, HeldOutErrorIsThatOfANewSession) {
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal(0, 1);
    Labelled labelled;
    labelled.name = "sessions.csv";
    labelled.channels = {"C1", "C2", "C3", "C4", "C5", "C6"};
    for (std::size_t s = 0; s < 6; ++s) {
        labelled.sessions.push_back("day " + std::to_string(s));
        std::vector<double> fingerprint(6);
        for (auto& f : fingerprint) f = normal(random);
        const double load = normal(random);  // N: different in each session
        for (int i = 0; i < 100; ++i) {
            LabelledRow row{
                .line = 2, .channel = fingerprint, .wrench_S = only_fz(load + 0.1 * normal(random)), .session = s};
            for (auto& c : row.channel) c += 0.01 * normal(random);
            labelled.rows.push_back(row);
        }
    }
    FitRequest request = generic();
    request.zero_drift = 0;  // otherwise the fit allows for zeros as different as those of these sessions
    const FitReport report = fit(labelled, request);
    EXPECT_EQ(report.calibration.validation, "leave one session out (6 sessions)");
    EXPECT_GT(report.components[0].held_out_rms, 0.6);  // N
    const auto decoupler = make_decoupler(report.calibration);
    int within = 0;
    for (const auto& [row, estimated] : report.held_out) {
        const double sd = std::hypot(report.calibration.sd[0], report.calibration.sd_slope[0] * estimated[2]);
        within += std::abs(estimated[2] - row->wrench_S[2]) <= sd ? 1 : 0;
    }
    EXPECT_GT(within / 600.0, 0.63);  // and more, because sd is at least the error of the worst session
    EXPECT_TRUE(warns(report, "no smaller than the spread"));
    for (std::size_t i = 0; i < labelled.rows.size(); ++i)
        labelled.rows[i].session = i % 6;                                  // rows of all days in each part
    EXPECT_LT(fit(labelled, generic()).components[0].held_out_rms, 0.15);  // N
}

// One session that drifts: each stretch of time has its own state, and neighbouring rows are alike.
TEST(Fit, HoldsOutStretchesOfTimeNotRowsAtRandom) {
    std::mt19937_64 random(6);
    std::normal_distribution<double> normal(0, 1);
    auto labelled = random_rows(1000, 3, [](const std::vector<double>& r) { return only_fz(r[0]); });
    for (std::size_t i = 0; i < 1000; ++i) {
        const double t = double(i) / 1000;
        auto& row = labelled.rows[i];
        row.wrench_S = only_fz(0.2 * row.channel[0] + std::sin(9 * t));
        row.channel[1] = t + 1e-3 * normal(random);
        row.channel[2] = t * t + 1e-3 * normal(random);
    }
    const FitReport report = fit(labelled, generic());
    EXPECT_TRUE(has_way(report, "leave one of 5 stretches of time out"));
    EXPECT_EQ(report.calibration.validation, "leave the last third of the rows out") << "what drifts is farthest off there";
    EXPECT_TRUE(warns(report, "one session only"));
    // The order in the file is arbitrary.
    for (std::size_t i = 0; i < 1000; ++i) labelled.rows[i].t_ns = 1'000'000 * (i + 1);
    auto shuffled = labelled;
    std::shuffle(shuffled.rows.begin(), shuffled.rows.end(), random);
    EXPECT_NEAR(fit(shuffled, generic()).components[0].held_out_rms, report.components[0].held_out_rms, 1e-9);
    // Every fifth row is left out in turn, which is equivalent to a random split.
    labelled.sessions = {"0", "1", "2", "3", "4"};
    for (std::size_t i = 0; i < 1000; ++i) labelled.rows[i].session = i % 5;
    const double flattered = fit(labelled, generic()).components[0].held_out_rms;
    EXPECT_GT(report.components[0].held_out_rms, 1.5 * flattered);
}

TEST(Fit, RefusesAnAxisThatWasNeverLoaded) {
    const auto labelled =
        random_rows(100, 3, [](const std::vector<double>& r) { return Wrench{0, kNaN, r[0], kNaN, kNaN, kNaN}; });
    EXPECT_NE(refusal(labelled, generic()).find("fx_N is always 0: load the sensor along this axis"), std::string::npos);
}

TEST(Fit, RefusesAxesThatWereOnlyLoadedTogether) {
    const auto together = [](const std::vector<double>& r) { return Wrench{r[0], kNaN, r[1], kNaN, 1e-3 * r[0], kNaN}; };
    EXPECT_NE(refusal(random_rows(100, 3, together), generic()).find("labels of fx my follow from each other"),
              std::string::npos);
    const auto nearly = [](const std::vector<double>& r) {
        return Wrench{r[0], kNaN, r[1], kNaN, 1e-3 * r[0] + 3e-5 * r[2], kNaN};
    };
    EXPECT_TRUE(warns(fit(random_rows(100, 3, nearly), generic()), "fx my hardly vary independently"));
}

TEST(Fit, RefusesTooFewRows) {
    const auto force = [](const std::vector<double>& r) { return only_fz(r[0]); };
    EXPECT_NE(refusal(random_rows(11, 3, force), generic()).find("11 rows with fz for 4 coefficients; at least 12"),
              std::string::npos);
    EXPECT_EQ(refusal(random_rows(12, 3, force), generic()), "");
}

TEST(Fit, NamesTheChannelsThatRepeatEachOther) {
    auto labelled = random_rows(100, 4, [](const std::vector<double>& r) { return only_fz(r[0]); });
    for (auto& row : labelled.rows) row.channel[3] = 2 * row.channel[1] + 5;
    const std::string text = refusal(labelled, generic());
    EXPECT_NE(text.find("the channels C2 C4 are a combination of each other"), std::string::npos) << text;
}

TEST(Fit, SaysWhenChannelsNearlyRepeatEachOther) {
    auto labelled = random_rows(100, 3, [](const std::vector<double>& r) { return only_fz(r[0]); });
    for (auto& row : labelled.rows) row.channel[2] = row.channel[1] + 1e-4 * row.channel[2];
    const FitReport report = fit(labelled, generic());
    EXPECT_TRUE(warns(report, "condition number"));
    EXPECT_GT(report.calibration.condition, 1e4);
    EXPECT_LT(report.calibration.condition, 1e5);
}

TEST(Fit, LeavesOutAChannelThatNeverChanges) {
    auto labelled = random_rows(100, 3, [](const std::vector<double>& r) { return only_fz(r[0] + r[2]); });
    for (auto& row : labelled.rows) row.channel[1] = 7;
    const FitReport report = fit(labelled, generic());
    EXPECT_EQ(report.calibration.channels, (std::vector<std::string>{"C1", "C3"}));
    EXPECT_TRUE(warns(report, "channel C2 is always 7"));
}

TEST(Fit, NamesALabelThatCannotBeRight) {
    auto labelled = random_rows(200, 3, [](const std::vector<double>& r) { return only_fz(r[0] + r[2]); });
    labelled.rows[150].wrench_S[2] = -1.9;
    labelled.rows[150].channel = {0.9, 0, 0.9};
    const FitReport report = fit(labelled, generic());
    EXPECT_TRUE(warns(report, "1 of 200 rows disagree with the rest in fz_N (worst made.csv:152"));
    EXPECT_TRUE(warns(report, "left out: made.csv:152: fz_N is -1.9, its channels say 1.8 N"));
}

// A label with a lost decimal point would make every error a small share of full scale, and hide other outliers.
TEST(Fit, ALabelThatIsLeftOutSetsNoFullScale) {
    auto labelled = random_rows(200, 3, [](const std::vector<double>& r) { return only_fz(r[0] + r[2]); });
    labelled.rows[50].wrench_S[2] = 1000;
    labelled.rows[150].wrench_S[2] *= -1;
    labelled.rows[150].wrench_S[2] += 1;
    const FitReport report = fit(labelled, generic());
    EXPECT_EQ(report.calibration.rows, 198);
    EXPECT_EQ(report.components[0].rows, 198);
    EXPECT_LT(report.calibration.full_scale[0], 2);  // N
    EXPECT_LT(report.components[0].spread, 2);
    EXPECT_EQ(decouple(*make_decoupler(report.calibration), {4, 0, 4}).quality(), TACTILED_UNCERTAIN);
}

TEST(Fit, SaysWhenAChannelIsTheLabel) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> noise(0, 1e-4);
    auto labelled = random_rows(200, 3, [&](const std::vector<double>& r) { return only_fz(r[0] + r[2] + noise(random)); });
    EXPECT_FALSE(warns(fit(labelled, generic()), "copy of the label"));
    for (auto& row : labelled.rows) row.channel[1] = 1000 * row.wrench_S[2];
    EXPECT_TRUE(warns(fit(labelled, generic()), "copy of the label"));
}

TEST(Fit, SaysWhichParameterWasNotUsed) {
    const auto labelled = random_rows(60, 3, [](const std::vector<double>& r) { return only_fz(r[0]); });
    FitRequest request = generic();
    request.parameters["area_m2"] = 3e-5;
    EXPECT_TRUE(warns(fit(labelled, request), "parameter area_m2 = 3e-05 was not used"));
    EXPECT_FALSE(warns(fit(labelled, generic()), "was not used"));
}

TEST(Fit, RefusesUnknownModels) {
    const auto labelled = random_rows(100, 3, [](const std::vector<double>& r) { return only_fz(r[0]); });
    FitRequest request = generic();
    request.model = "tabel";
    try {
        (void)fit(labelled, request);
        FAIL();
    } catch (const SetupError& error) {
        EXPECT_NE(std::string(error.what()).find("did you mean \"table\"?"), std::string::npos);
    }
}

// ---- model "table" ----

Labelled table_rows(const std::vector<std::string>& channels, double noise_sd) {
    Labelled labelled;
    labelled.name = "table.csv";
    labelled.channels = channels;
    std::mt19937_64 random(8);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal(0, 1);
    const double sign_x[8] = {-1, 1, 0, 0, 1, -1, 0, 0}, sign_y[8] = {0, 0, -1, 1, 0, 0, 1, -1};
    for (int i = 0; i < 400; ++i) {
        const double fx = 0.3 * uniform(random), fy = 0.3 * uniform(random), n = std::abs(uniform(random));
        LabelledRow row{.line = i + 2, .channel = {}, .wrench_S = {fx, fy, -n, kNaN, kNaN, kNaN}, .session = 0};
        for (const auto& name : channels) {
            const auto k = std::size_t(name[1] - '1');
            const bool inner = k % 2 == 0;
            const double tangential = inner ? kTangential_per_N : kOuter_per_N;
            row.channel.push_back(0.001 * double(k) + tangential * (sign_x[k] * fx + sign_y[k] * fy) +
                                  (inner ? kNormal_per_N * n : 0) + noise_sd * normal(random));
        }
        labelled.rows.push_back(row);
    }
    return labelled;
}

TEST(FitTable, RecoversGainsZeroAndNoise) {
    for (const auto& channels : {inner_gauges(), all_gauges(), std::vector<std::string>{"R7", "R5", "R1", "R3"}}) {
        const FitReport report = fit(table_rows(channels, 20e-6), table());
        const auto& parameters = report.calibration.parameters;
        EXPECT_NEAR(parameters.at("normal_inner"), kNormal_per_N, 1e-5);          // 1/N, 0.05 %
        EXPECT_NEAR(parameters.at("tangential_inner"), kTangential_per_N, 1e-5);  // 0.1 %
        EXPECT_NEAR(parameters.at("noise"), 20e-6, 2e-6);
        if (channels.size() == 8) {
            EXPECT_NEAR(parameters.at("tangential_outer"), kOuter_per_N, 1e-5);
            EXPECT_NEAR(parameters.at("normal_outer"), 0, 1e-5);
        }
        for (std::size_t k = 0; k < channels.size(); ++k)
            EXPECT_NEAR(report.calibration.zero[k], 0.001 * (channels[k][1] - '1'), 1e-5);
        const auto decoupler = make_decoupler(report.calibration);
        EXPECT_EQ(decouple(*decoupler, report.calibration.zero).quality(), TACTILED_GOOD);
        for (const auto& component : report.components) EXPECT_LT(component.held_out_rms, 0.002);  // N
    }
}

TEST(FitTable, RefusesSwappedGaugesAndPressesThatPull) {
    auto labelled = table_rows(inner_gauges(), 0);
    for (auto& row : labelled.rows) row.wrench_S[2] = -row.wrench_S[2];
    EXPECT_NE(refusal(labelled, table()).find("the fit of normal_inner is"), std::string::npos);
    labelled = table_rows(inner_gauges(), 0);
    labelled.channels = {"R5", "R7", "R1", "R3"};
    EXPECT_NE(refusal(labelled, table()).find("the fit of tangential_inner is"), std::string::npos);
}

TEST(FitTable, RefusesWhatDoesNotShowTheThreeForces) {
    auto labelled = table_rows(inner_gauges(), 0);
    for (auto& row : labelled.rows) row.wrench_S[1] = kNaN;
    EXPECT_NE(refusal(labelled, table()).find("needs the labels fx_N, fy_N and fz_N"), std::string::npos);
    labelled = table_rows(inner_gauges(), 0);
    for (auto& row : labelled.rows) row.channel[1] = 0.25;
    EXPECT_NE(refusal(labelled, table()).find("channel R3 is always 0.25"), std::string::npos);
}

TEST(FitTable, LeavesOtherColumnsAlone) {
    auto labelled = table_rows(inner_gauges(), 20e-6);
    labelled.channels.emplace_back("temperature_C");
    for (auto& row : labelled.rows) row.channel.push_back(20);
    const FitReport report = fit(labelled, table());
    EXPECT_EQ(report.calibration.channels, inner_gauges());
    EXPECT_TRUE(warns(report, "temperature_C is no gauge"));
}

}  // namespace
}  // namespace tactiled
