// The joint domain: readings that no load causes are not GOOD, and readings that a load causes are.
#include "decoupling/joint_domain.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "config/calibration.hpp"
#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

const std::string kSkin = TACTILED_SOURCE_DIR "/tests/data/eflesh/normal_labelled.csv";

Labelled session(const std::string& name) { return read_labelled(kSkin, {.sessions = {name}, .channels = {}}); }

// ---- a real skin, fitted on session 1 and damaged in session 2 ---------------------------------------------------------

struct Share {
    std::size_t rows = 0, good = 0, wrong = 0;  // wrong: GOOD and off by more than 10 % of full scale
};

class Skin : public ::testing::TestWithParam<const char*> {
protected:
    void judge(std::vector<double> channel, double label_N, Share& share) {
        const Estimate estimate = decouple(*decoupler, channel);
        ++share.rows;
        if (estimate.quality() != TACTILED_GOOD) return;
        ++share.good;
        share.wrong += std::abs(estimate.wrench_S[2] - label_N) > 0.1 * calibration.full_scale[0];
    }
    using Damage = std::function<void(std::vector<double>&, std::size_t)>;
    Share damaged(const Damage& damage, std::size_t cases) {
        Share share;
        for (const auto& row : unseen.rows) {
            if (std::isnan(row.wrench_S[2])) continue;
            for (std::size_t k = 0; k < cases; ++k) {
                std::vector<double> channel = row.channel;
                damage(channel, k);
                judge(std::move(channel), row.wrench_S[2], share);
            }
        }
        return share;
    }

    const Labelled unseen = session("2");
    const Calibration calibration =
        fit(session("1"), {.model = "generic", .method = GetParam(), .serial = "", .date = ""}).calibration;
    const std::unique_ptr<Decoupler> decoupler = make_decoupler(calibration);
};

TEST_P(Skin, OneChannelInFifteenThatIsDamagedIsNotGoodAndWrong) {
    const std::size_t n = calibration.channels.size();
    const auto range = [&](std::size_t k) { return calibration.channel_most[k] - calibration.channel_least[k]; };
    const std::vector<std::pair<const char*, Damage>> kinds{
        {"at rest", [&](auto& channel, std::size_t k) { channel[k] = calibration.zero[k]; }},
        {"at zero", [&](auto& channel, std::size_t k) { channel[k] = 0; }},
        {"at half gain", [&](auto& channel, std::size_t k) { channel[k] *= 0.5; }},
        {"turned round", [&](auto& channel, std::size_t k) { channel[k] *= -1; }},
        {"shifted by 20 % of its range", [&](auto& channel, std::size_t k) { channel[k] += 0.2 * range(k); }}};
    for (const auto& [name, damage] : kinds) {
        const Share share = damaged(damage, n);
        RecordProperty(std::string(name) + ", wrong", std::to_string(100.0 * double(share.wrong) / double(share.rows)));
        EXPECT_LE(share.wrong, share.rows / 200) << name << " of " << share.rows;
    }
}

TEST_P(Skin, TwoChannelsThatAreExchangedAreNotGoodAndWrong) {
    const std::size_t n = calibration.channels.size();
    std::mt19937 random(3);
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    while (pairs.size() < 40)
        if (const auto a = random() % n, b = random() % n; a != b) pairs.emplace_back(a, b);
    const Share share = damaged(
        [&](auto& channel, std::size_t k) { std::swap(channel[pairs[k].first], channel[pairs[k].second]); }, pairs.size());
    EXPECT_LE(share.wrong, share.rows / 200) << "of " << share.rows;
}

TEST_P(Skin, AnUndamagedSessionStaysGood) {
    const Share share = damaged([](auto&, std::size_t) {}, 1);
    EXPECT_GE(share.good, share.rows * 99 / 100) << "of " << share.rows;
    EXPECT_GT(calibration.joint_domain.limit, 0);
    EXPECT_LE(calibration.joint_domain.false_alarms, 0.001);
}

INSTANTIATE_TEST_SUITE_P(Eflesh, Skin, ::testing::Values("matrix", "quadratic"));

// ---- a load cell of six axes -------------------------------------------------------------------------------------------

// Eight channels, six components; each axis loaded alone, as with dead weights, at both signs.
class LoadCell : public ::testing::Test {
protected:
    LoadCell() {
        labelled.name = "made";
        for (std::size_t k = 0; k < 8; ++k) labelled.channels.push_back("g" + std::to_string(k));
        for (auto& row : gain)
            for (double& value : row) value = normal(random);
        for (int repeat = 0; repeat < 3; ++repeat)
            for (std::size_t axis = 0; axis < 6; ++axis)
                for (const double load : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
                    Wrench wrench{};
                    wrench[axis] = 10 * load;
                    labelled.rows.push_back({.line = std::int64_t(labelled.rows.size()) + 2,
                                             .channel = reading(wrench),
                                             .wrench_S = wrench,
                                             .t_ns = labelled.rows.size() * 1'000'000'000});
                }
    }
    std::vector<double> reading(const Wrench& wrench) {
        std::vector<double> channel(8);
        for (std::size_t k = 0; k < 8; ++k) {
            for (std::size_t c = 0; c < 6; ++c) channel[k] += gain[k][c] * wrench[c] * 0.1;
            channel[k] += 0.001 * normal(random);
        }
        return channel;
    }

    std::mt19937 random{11};
    std::normal_distribution<double> normal;
    std::array<std::array<double, 6>, 8> gain{};
    Labelled labelled;
};

TEST_F(LoadCell, LoadsThatTheCalibrationShowedOneByOneMayComeTogether) {
    const auto calibration = fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = ""}).calibration;
    ASSERT_GT(calibration.joint_domain.limit, 0);
    int good = 0, total = 0;
    for (int i = 0; i < 2000; ++i) {
        Wrench wrench;
        for (double& component : wrench) component = std::uniform_real_distribution<double>(-10, 10)(random);
        const auto channel = reading(wrench);
        // A reading beyond the range of a channel, or beyond the full scale by noise, has another reason.
        bool in_range = true;
        for (std::size_t k = 0; k < 8; ++k)
            in_range = in_range && channel[k] >= calibration.channel_least[k] && channel[k] <= calibration.channel_most[k];
        if (!in_range) continue;
        ++total;
        good += joint_distance(calibration.joint_domain, channel) <= calibration.joint_domain.limit;
    }
    EXPECT_GT(total, 100);
    EXPECT_EQ(good, total);
}

// Averaged loads, and samples of one conversion each.
TEST_F(LoadCell, NoiseOfAQuarterOfAPercentOfTheRangeIsInside) {
    const auto calibration = fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = ""}).calibration;
    ASSERT_GT(calibration.joint_domain.limit, 0);
    int inside = 0, total = 0;
    for (int repeat = 0; repeat < 50; ++repeat)
        for (const auto& row : labelled.rows) {
            auto channel = row.channel;
            for (std::size_t k = 0; k < channel.size(); ++k)
                channel[k] += 0.0025 * (calibration.channel_most[k] - calibration.channel_least[k]) * normal(random);
            ++total;
            inside += joint_distance(calibration.joint_domain, channel) <= calibration.joint_domain.limit;
        }
    EXPECT_GE(inside, total * 998 / 1000);
}

TEST_F(LoadCell, AGaugeThatDiedUnderLoadIsOutside) {
    const auto calibration = fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = ""}).calibration;
    const auto decoupler = make_decoupler(calibration);
    int good = 0, total = 0;
    for (std::size_t dead = 0; dead < 8; ++dead)
        for (const auto& row : labelled.rows) {
            auto channel = row.channel;
            if (std::abs(channel[dead]) < 0.3) continue;  // skips loads under which it hardly changes
            channel[dead] = 0;
            ++total;
            good += decouple(*decoupler, channel).quality() == TACTILED_GOOD;
        }
    EXPECT_GT(total, 100);
    EXPECT_LE(good, total / 50);
}

TEST_F(LoadCell, TooFewRowsHaveNoJointDomain) {
    labelled.rows.resize(24);
    for (auto& row : labelled.rows)
        for (std::size_t c = 1; c < 6; ++c) row.wrench_S[c] = kNaN;
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) labelled.rows[i].wrench_S[0] = double(i);
    Calibration calibration;
    try {
        calibration = fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = ""}).calibration;
    } catch (const Undetermined&) {
        return;  // too few for the fit as well
    }
    EXPECT_EQ(calibration.joint_domain.limit, 0);
}

// ---- one estimate --------------------------------------------------------------------------------------------------------

Calibration by_hand() {
    Calibration calibration;
    calibration.path = "c.toml";
    calibration.model = "generic";
    calibration.method = "matrix";
    calibration.channels = {"a", "b"};
    calibration.zero = {0, 0};
    calibration.components = {"fz"};
    calibration.matrix = {{1, 1}};
    calibration.sd = {0.5};
    calibration.full_scale = {100};
    calibration.joint_domain = {.mean = {1, 1}, .whitening = {{1}, {-10, 10}}, .limit = 2, .false_alarms = 0};
    return calibration;
}

TEST(JointDomain, TheStandardDeviationGrowsWithTheDistance) {
    const auto decoupler = make_decoupler(by_hand());
    const Estimate inside = decouple(*decoupler, {2, 2});
    EXPECT_EQ(inside.quality(), TACTILED_GOOD);
    EXPECT_EQ(inside.sd[2], 0.5);
    const Estimate outside = decouple(*decoupler, {1, 2});  // d = 10
    EXPECT_EQ(outside.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(outside.reasons, TACTILED_OUTSIDE_DOMAIN);
    EXPECT_NEAR(outside.sd[2], 0.5 * 10 / 2, 1e-12);
    EXPECT_EQ(outside.wrench_S[2], 3);
}

TEST(JointDomain, AMissingChannelAndAnyBitsAreLeftToTheMethod) {
    const auto decoupler = make_decoupler(by_hand());
    EXPECT_EQ(decouple(*decoupler, {1, kNaN}, 2).quality(), TACTILED_BAD);
    for (const double odd : {kNaN, 1e300, -1e300, std::numeric_limits<double>::infinity()}) {
        const Estimate estimate = decouple(*decoupler, {odd, 1});
        EXPECT_NE(estimate.quality(), TACTILED_GOOD) << odd;
        if (estimate.quality() == TACTILED_UNCERTAIN) { EXPECT_TRUE(std::isfinite(estimate.sd[2])) << odd; }
    }
}

TEST(JointDomain, ServesEachMethodOfAuto) {
    Calibration calibration = by_hand();
    calibration.channel_least = {-100, -100};
    calibration.channel_most = {100, 100};
    const auto decoupler = make_decoupler(calibration, "auto", 1000);
    EXPECT_EQ(decouple(*decoupler, {1, 2}).quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(decouple(*decoupler, {2, 2}).quality(), TACTILED_GOOD);
}

TEST(JointDomain, ComesBackToTheLastBit) {
    const Calibration calibration = by_hand();
    Problems problems;
    const Calibration loaded = parse_calibration(calibration_text(calibration), "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(loaded.joint_domain.mean, calibration.joint_domain.mean);
    EXPECT_EQ(loaded.joint_domain.whitening, calibration.joint_domain.whitening);
    EXPECT_EQ(loaded.joint_domain.limit, 2);
}

TEST(JointDomain, OfAWrongShapeIsRefused) {
    for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{{"mean = [1.0, 1.0]", "mean = [1.0]"},
                                                                                   {"limit = 2.0", "limit = 0.0"},
                                                                                   {"limit = 2.0", "limit = nan"},
                                                                                   {"    [-10.0, 10.0],\n", ""},
                                                                                   {"[-10.0, 10.0]", "[10.0]"}}) {
        const auto problems = problems_of(by_hand(), from, to);
        ASSERT_EQ(problems.size(), 1u) << to;
        EXPECT_NE(problems.front().find("joint_domain"), std::string::npos) << problems.front();
    }
    Calibration calibration = by_hand();
    calibration.joint_domain.whitening.pop_back();
    EXPECT_NE(refusal(calibration).find("joint_domain"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
