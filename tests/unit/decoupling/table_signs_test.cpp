// Method "signs": every row of the decision table of Lee et al., and cases where its signs are ambiguous or wrong.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "made_by_hand.hpp"

namespace tactiled {
namespace {

// The documents' table 2, written from them and not from the code: load and the signs of R1 R3 R5 R7.
struct Row {
    std::uint32_t number;
    int x, y;
    bool press;
    const char* signs;
};
constexpr Row kRows[] = {{1, 0, 0, true, "++++"},    {2, 1, 0, false, "-0+0"},   {3, -1, 0, false, "+0-0"},
                         {4, 0, 1, false, "0-0+"},   {5, 0, -1, false, "0+0-"},  {6, 1, 1, false, "--++"},
                         {7, -1, 1, false, "+--+"},  {8, -1, -1, false, "++--"}, {9, 1, -1, false, "-++-"},
                         {10, 1, 0, true, "-+++"},   {11, -1, 0, true, "++-+"},  {12, 0, 1, true, "+-++"},
                         {13, 0, -1, true, "+++-"},  {14, 1, 1, true, "--++"},   {15, -1, 1, true, "+--+"},
                         {16, -1, -1, true, "++--"}, {17, 1, -1, true, "-++-"}};

Calibration signs_calibration() {
    Calibration calibration = table_calibration(inner_gauges());
    calibration.method = "signs";
    return calibration;
}

std::string signs_of(const std::vector<double>& reading) {
    std::string signs;
    for (const double r : reading) signs += r > 1e-4 ? '+' : r < -1e-4 ? '-' : '0';
    return signs;
}

// The tangential force is 3 times the press, more than 1.79, so the signs are those of the table.
TEST(TableSigns, TellsEveryRowOfTheDecisionTableApart) {
    const auto decoupler = make_decoupler(signs_calibration());
    for (const Row& row : kRows) {
        const double tangential_N = 0.6, press_N = row.press ? 0.2 : 0;
        const auto reading = reading_of(tangential_N * row.x, tangential_N * row.y, press_N);
        SCOPED_TRACE(row.number);
        EXPECT_EQ(signs_of(reading), row.signs);
        const Estimate estimate = decouple(*decoupler, reading);
        EXPECT_EQ(estimate.direction, row.number);
        EXPECT_EQ(estimate.reasons, 0u);
        EXPECT_NEAR(estimate.wrench_S[0], tangential_N * row.x, 1e-12);
        EXPECT_NEAR(estimate.wrench_S[1], tangential_N * row.y, 1e-12);
        EXPECT_NEAR(estimate.wrench_S[2], -press_N, 1e-12);
    }
}

// The authors' text requires the tangential force to dominate an equal normal force. By their sensitivities the
// normal force dominates by 1.79: the signs of rows 10 .. 17 become ++++, row 1. The class is still right, and
// marked.
TEST(TableSigns, MarksRowsWhoseSignsTheDominanceOfThePressChanges) {
    EXPECT_NEAR(kNormal_per_N / kTangential_per_N, 1.79, 0.01);
    const auto decoupler = make_decoupler(signs_calibration());
    for (const Row& row : kRows) {
        if (row.number < 10) continue;
        for (const double tangential_N : {0.5, 1.7 * 0.5, 1.9 * 0.5}) {
            const auto reading = reading_of(tangential_N * row.x, tangential_N * row.y, 0.5);
            const Estimate estimate = decouple(*decoupler, reading);
            SCOPED_TRACE(testing::Message() << row.number << " " << tangential_N);
            EXPECT_EQ(estimate.direction, row.number);
            const bool as_printed = tangential_N > 1.79 * 0.5;
            EXPECT_EQ(signs_of(reading), as_printed ? row.signs : "++++");
            EXPECT_EQ(estimate.reasons, as_printed ? 0u : std::uint32_t{TACTILED_DISAGREEMENT});
            EXPECT_EQ(estimate.quality(), as_printed ? TACTILED_GOOD : TACTILED_UNCERTAIN);
        }
    }
}

// Rows 6 and 14 have the same signs. The sum decides, and the sample is marked near the dead band.
TEST(TableSigns, TheSumDecidesTheFourPairsAndSaysWhereItHardlyDoes) {
    const auto decoupler = make_decoupler(signs_calibration());
    const double band_N = 2 * 5 * 20e-6 / (4 * kNormal_per_N);  // press whose sum is at its dead band
    for (std::uint32_t pair = 6; pair <= 9; ++pair) {
        const Row& row = kRows[pair - 1];
        const auto at = [&](double press_N) { return decouple(*decoupler, reading_of(0.6 * row.x, 0.6 * row.y, press_N)); };
        EXPECT_EQ(at(0).direction, pair);
        EXPECT_EQ(at(0).quality(), TACTILED_GOOD);
        EXPECT_EQ(at(0.9 * band_N).direction, pair);
        EXPECT_EQ(at(0.9 * band_N).reasons, std::uint32_t{TACTILED_DISAGREEMENT});
        EXPECT_EQ(at(1.1 * band_N).direction, pair + 8);
        EXPECT_EQ(at(1.1 * band_N).reasons, std::uint32_t{TACTILED_DISAGREEMENT});
        EXPECT_EQ(at(2.1 * band_N).direction, pair + 8);
        EXPECT_EQ(at(2.1 * band_N).quality(), TACTILED_GOOD);
    }
}

TEST(TableSigns, RestIsNoDirectionAndAPullIsNoRow) {
    const auto decoupler = make_decoupler(signs_calibration());
    const Estimate rest = decouple(*decoupler, reading_of(0, 0, 0));
    EXPECT_EQ(rest.direction, 0u);
    EXPECT_EQ(rest.quality(), TACTILED_GOOD);
    EXPECT_EQ(rest.wrench_S[2], 0);
    const Estimate pull = decouple(*decoupler, reading_of(0, 0, -0.5));
    EXPECT_EQ(pull.direction, 0u);
    EXPECT_EQ(pull.reasons, std::uint32_t{TACTILED_OUTSIDE_DOMAIN});
    EXPECT_NEAR(pull.wrench_S[2], 0.5, 1e-12);
}

TEST(TableSigns, NoiseDoesNotMakeADirection) {
    const auto decoupler = make_decoupler(signs_calibration());
    std::mt19937_64 random(1);
    std::normal_distribution<double> noise(0, 20e-6);
    int false_directions = 0;
    for (int i = 0; i < 200000; ++i)
        false_directions +=
            decouple(*decoupler, {noise(random), noise(random), noise(random), noise(random)}).direction != 0 ? 1 : 0;
    EXPECT_LE(false_directions, 2);  // 5 sigma, three times per sample: 0.3 expected
}

TEST(TableSigns, ForcesComeInLevelsAndTheStandardDeviationSaysSo) {
    Calibration calibration = signs_calibration();
    calibration.parameters["level_tangential"] = 0.25;
    calibration.parameters["level_normal"] = 0.5;
    const auto decoupler = make_decoupler(calibration);
    double squares = 0;
    int n = 0;
    for (double newton = 0.5; newton < 2.5; newton += 0.001, ++n) {
        const Estimate estimate = decouple(*decoupler, reading_of(newton, 0, newton));
        const double level = estimate.wrench_S[0] / 0.25;
        ASSERT_NEAR(level, std::round(level), 1e-12);
        squares += std::pow(estimate.wrench_S[0] - newton, 2);
        ASSERT_NEAR(estimate.sd[0], std::hypot(0.01, 0.25 / std::sqrt(12.0)), 1e-12);
        ASSERT_NEAR(estimate.sd[2], std::hypot(0.02, 0.5 / std::sqrt(12.0)), 1e-12);
    }
    EXPECT_NEAR(std::sqrt(squares / n), 0.25 / std::sqrt(12.0), 0.002);
}

TEST(TableSigns, AGaugeThatContradictsTheOthersIsDisagreementAndAMissingOneIsBad) {
    const auto decoupler = make_decoupler(signs_calibration());
    auto reading = reading_of(0.3, -0.2, 1);
    reading[2] = 0;
    const Estimate dead = decouple(*decoupler, reading);
    EXPECT_NE(dead.reasons & TACTILED_DISAGREEMENT, 0u);
    EXPECT_TRUE(std::isnan(dead.sd[0]));
    EXPECT_EQ(decouple(*decoupler, reading, 1u).quality(), TACTILED_BAD);
    EXPECT_EQ(decouple(*decoupler, {1e308, -1e308, 1e308, 1e308}).direction > 17, false);
}

TEST(TableSigns, RefusesWhatItCannotUse) {
    Calibration calibration = signs_calibration();
    calibration.parameters["dead_bant"] = 1e-4;
    EXPECT_NE(refusal(calibration).find("did you mean dead_band?"), std::string::npos);
    calibration = signs_calibration();
    calibration.parameters["level_normal"] = 0;
    EXPECT_NE(refusal(calibration).find("level_normal"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
