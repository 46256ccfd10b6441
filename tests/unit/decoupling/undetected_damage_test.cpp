// Undetected damage of a channel, as a calibration states it.
//
// Ways in which the share could be wrong, each with a test below:
// 1. Its definition: one channel of one component has shares that follow from the loads alone.
// 2. A sensor whose channels contradict damage states some; one with no channel to spare states none.
// 3. The share of one method is that of another, or of a calibration that is not finished.
// 4. The file loses it, or accepts one that does not fit its channels.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "config/calibration.hpp"
#include "decoupling/fit/damage.hpp"
#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

enum : std::size_t { kStuck, kHalfGain, kDrifting, kExchanged, kZero };

// Random loads of one component a channel, -1 .. 1 N, or of fz alone, -1 .. 0 N; further channels are sums of the first.
Labelled recorded(std::size_t components, std::size_t channels, std::size_t rows = 1000) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal(0, 1);
    Labelled labelled;
    labelled.name = "made";
    std::vector<std::vector<double>> gain(channels, std::vector<double>(components));
    for (std::size_t k = 0; k < channels; ++k) {
        labelled.channels.push_back(fmt::format("c{}", k));
        for (std::size_t c = 0; c < components; ++c) gain[k][c] = k < components ? double(k == c) : uniform(random);
    }
    for (std::size_t i = 0; i < rows; ++i) {
        LabelledRow row{.line = std::int64_t(i) + 2, .channel = {}, .t_ns = (i + 1) * 100'000'000};
        std::vector<double> load;
        for (std::size_t c = 0; c < components; ++c) {
            load.push_back(components == 1 ? (uniform(random) - 1) / 2 : uniform(random));
            row.wrench_S[components == 1 ? 2 : c] = load.back();
        }
        for (std::size_t k = 0; k < channels; ++k) {
            double value = 1e-3 * normal(random);
            for (std::size_t c = 0; c < components; ++c) value -= gain[k][c] * load[c];
            row.channel.push_back(value);
        }
        labelled.rows.push_back(std::move(row));
    }
    return labelled;
}

Calibration calibrated(const Labelled& labelled, const std::string& method = "matrix") {
    return fit(labelled, {.model = "generic", .method = method, .serial = "", .date = ""}).calibration;
}

// ---- 1. the definition ---------------------------------------------------------------------------------------------------

TEST(UndetectedDamage, OfOneChannelFollowsFromTheLoads) {
    const UndetectedDamage damage = calibrated(recorded(1, 1)).undetected_damage;
    ASSERT_TRUE(damage.is_known());
    // The standard error of a share of 500 rows is 0.022; three of them.
    constexpr double kTolerance = 0.066;
    EXPECT_NEAR(damage.share[kZero][0], 0.9, kTolerance) << "loads above 10 %";
    EXPECT_NEAR(damage.share[kHalfGain][0], 0.8, kTolerance) << "loads above 20 %";
    EXPECT_NEAR(damage.share[kStuck][0], 0.81, kTolerance) << "two loads that differ by more than 10 %";
    // From a third of the recording on, while load + 30 % x part is at most 105 %: the integral of 1.05 - 0.3 t.
    EXPECT_NEAR(damage.share[kDrifting][0], 0.567, kTolerance);
    EXPECT_EQ(damage.share[kExchanged][0], 0) << "there is no other channel";
    EXPECT_EQ(damage.worst_kind(), std::size_t(kZero));
}

TEST(UndetectedDamage, HasTheReadingsThatItsNameSays) {
    const Labelled labelled = recorded(3, 3, 10);
    const Rows rows = pointers(labelled.rows);
    Calibration calibration;
    calibration.channels = labelled.channels;
    calibration.zero = {0.5, 0, 0};
    calibration.channel_least = {-1, -1, -1};
    calibration.channel_most = {1, 1, 1};
    DamagedRows damaged(rows, calibration);
    const std::vector<double>& sound = rows[4]->channel;
    EXPECT_EQ(damaged.reading(kHalfGain, 4, 0), (std::vector<double>{0.5 + (sound[0] - 0.5) / 2, sound[1], sound[2]}));
    EXPECT_EQ(damaged.reading(kDrifting, 4, 1), (std::vector<double>{sound[0], sound[1] + 0.3 * 2 * 5 / 10, sound[2]}));
    EXPECT_EQ(damaged.reading(kZero, 4, 0), (std::vector<double>{0.5, sound[1], sound[2]}));
    std::set<double> stuck, partners;
    for (int draw = 0; draw < 100; ++draw) {
        stuck.insert(damaged.reading(kStuck, 4, 2)[2]);
        const std::vector<double> exchanged = damaged.reading(kExchanged, 4, 2);
        EXPECT_TRUE(exchanged[0] == sound[2] || exchanged[1] == sound[2]);
        partners.insert(exchanged[2]);
    }
    std::set<double> earlier;
    for (std::size_t i = 0; i < 4; ++i) earlier.insert(rows[i]->channel[2]);
    EXPECT_EQ(stuck, earlier);
    EXPECT_EQ(partners, (std::set<double>{sound[0], sound[1]}));
}

// ---- 2. redundancy -------------------------------------------------------------------------------------------------------

TEST(UndetectedDamage, IsSmallWithChannelsToSpareAndLargeWithout) {
    const UndetectedDamage spare = calibrated(recorded(3, 12)).undetected_damage,
                           none = calibrated(recorded(3, 3)).undetected_damage;
    ASSERT_TRUE(spare.is_known() && none.is_known());
    EXPECT_LE(spare.mean(spare.worst_kind()), 0.01);
    EXPECT_GE(none.mean(kHalfGain), 0.5);
    EXPECT_EQ(none.share[kHalfGain].size(), 3u);
}

TEST(UndetectedDamage, OfAChannelThatNoForceNeedsIsNone) {
    Labelled labelled = recorded(3, 3);
    std::mt19937 random(9);
    labelled.channels.emplace_back("noise");
    for (LabelledRow& row : labelled.rows) row.channel.push_back(std::normal_distribution<double>(0, 1)(random));
    const UndetectedDamage damage = calibrated(labelled).undetected_damage;
    ASSERT_TRUE(damage.is_known());
    EXPECT_EQ(damage.share[kZero][3], 0);
    EXPECT_EQ(damage.worst_channel(kHalfGain) == 3, false);
}

// ---- 3. methods and checks -----------------------------------------------------------------------------------------------

TEST(UndetectedDamage, IsThatOfTheFinishedCalibrationAndOfEachMethod) {
    const Labelled labelled = recorded(3, 5, 400);
    const Calibration calibration = calibrated(labelled, "auto");
    ASSERT_FALSE(calibration.others.empty());
    const Rows rows = pointers(labelled.rows);
    EXPECT_EQ(calibration.undetected_damage.share, undetected_damage(calibration, rows).share);
    for (const Fit& other : calibration.others)
        EXPECT_EQ(other.undetected_damage.share, undetected_damage(calibration.with_method(other.method), rows).share);
}

TEST(UndetectedDamage, OfAutoIsThatOfItsWorstMethod) {
    Calibration calibration;
    calibration.method = "matrix";
    for (auto& share : calibration.undetected_damage.share) share = {0.1};
    calibration.others.emplace_back().method = "rbf";
    EXPECT_TRUE(calibration.undetected_damage_of("").is_known());
    EXPECT_FALSE(calibration.undetected_damage_of("rbf").is_known());
    EXPECT_FALSE(calibration.undetected_damage_of("auto").is_known()) << "one method states nothing";
    for (auto& share : calibration.others.front().undetected_damage.share) share = {0.3};
    EXPECT_EQ(calibration.undetected_damage_of("auto").mean(0), 0.3);
    EXPECT_EQ(calibration.undetected_damage_of("matrix").mean(0), 0.1);
}

// ---- 4. the file ---------------------------------------------------------------------------------------------------------

TEST(UndetectedDamage, IsInTheFile) {
    const Calibration calibration = calibrated(recorded(3, 4, 400), "auto");
    Problems problems;
    const Calibration read = parse_calibration(calibration_text(calibration), "c.toml", problems);
    ASSERT_TRUE(problems.empty());
    EXPECT_EQ(read.undetected_damage.share, calibration.undetected_damage.share);
    ASSERT_EQ(read.others.size(), calibration.others.size());
    for (std::size_t i = 0; i < read.others.size(); ++i)
        EXPECT_EQ(read.others[i].undetected_damage.share, calibration.others[i].undetected_damage.share);
}

TEST(UndetectedDamage, ThatDoesNotFitTheFileIsNamed) {
    Calibration calibration = calibrated(recorded(3, 3));
    for (auto& share : calibration.undetected_damage.share) share = {0.5, 0.25, 0.125};
    const auto said = [&](const std::string& from, const std::string& to) {
        std::string all;
        for (const std::string& line : problems_of(calibration, from, to)) all += line;
        return all;
    };
    const std::string line = "undetected_damage.zero = [0.5, 0.25, 0.125]\n";
    EXPECT_EQ(said(line, line), "");
    EXPECT_NE(said(line, "").find("[undetected_damage]: key \"zero\" is missing"), std::string::npos) << said(line, "");
    EXPECT_NE(said(line, "undetected_damage.zero = [0.5, 0.25]\n").find("zero"), std::string::npos);
    EXPECT_NE(said(line, "undetected_damage.zero = [0.5, 0.25, 1.5]\n").find("0 .. 1"), std::string::npos)
        << said(line, "undetected_damage.zero = [0.5, 0.25, 1.5]\n");
}

}  // namespace
}  // namespace tactiled
