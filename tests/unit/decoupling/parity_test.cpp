// Parity: a channel that disagrees with the others is found, named, and replaced by what they say.
#include "decoupling/parity.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "decoupling/fit/domain_fit.hpp"
#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

// Six channels under three forces that wander, with a little curvature: r = G f + curved (G f)^2.
class Redundant : public ::testing::Test {
protected:
    explicit Redundant(double curved = 0.05) : curved_(curved) {
        for (auto& row : gain_)
            for (double& value : row) value = normal_(random_);
        Labelled labelled{.name = "made", .channels = {}, .sessions = {}, .rows = {}};
        for (std::size_t k = 0; k < kChannels; ++k) labelled.channels.push_back("g" + std::to_string(k));
        for (std::size_t i = 0; i < 600; ++i) {
            const Wrench load = random_load();
            labelled.rows.push_back({.line = std::int64_t(i) + 2,
                                     .channel = reading(load),
                                     .wrench_S = load,
                                     .session = 0,
                                     .t_ns = (i + 1) * 1'000'000'000});
        }
        calibration =
            fit(labelled, {.model = "generic", .method = "quadratic", .serial = "", .date = "", .parity = true}).calibration;
        decoupler = make_decoupler(calibration);
    }
    Wrench random_load() {
        std::uniform_real_distribution<double> uniform(-1, 1);
        return {uniform(random_), uniform(random_), -1 + 0.9 * uniform(random_), kNaN, kNaN, kNaN};
    }
    std::vector<double> reading(const Wrench& load) {
        std::vector<double> channel(kChannels);
        for (std::size_t k = 0; k < kChannels; ++k) {
            for (std::size_t c = 0; c < 3; ++c) channel[k] += gain_[k][c] * load[c];
            channel[k] += curved_ * channel[k] * channel[k] + 0.002 * normal_(random_);
        }
        return channel;
    }
    // A load that moves slowly from one random load to the next, 1000 samples each; `damage` is done to each reading.
    template <class Damage>
    void run(std::size_t samples, const Damage& damage) {
        samples_ = good = wrong = named = within = 0;
        Wrench from = random_load(), to = random_load();
        for (std::size_t i = 0; i < samples; ++i) {
            const double share = double(i % 1000) / 1000;
            Wrench load = kUnseen;
            for (std::size_t c = 0; c < 3; ++c) load[c] = std::lerp(from[c], to[c], share);
            if (i % 1000 == 999) from = to, to = random_load();
            std::vector<double> channel = reading(load);
            damage(channel);
            t_ns_ += 1'000'000;
            last = decoupler->decouple({.channel = channel, .t_ns = t_ns_});
            ++samples_;
            const double error = last.wrench_S[2] - load[2];
            if (last.quality() == TACTILED_GOOD) {
                ++good;
                wrong += std::abs(error) > 5 * last.sd[2];
            } else if (last.quality() == TACTILED_UNCERTAIN && std::isfinite(last.sd[2])) {
                ++named;
                within += std::abs(error) <= 2 * last.sd[2];
            }
        }
    }

    static constexpr std::size_t kChannels = 6;
    double curved_;
    std::mt19937 random_{3};
    std::normal_distribution<double> normal_;
    std::array<std::array<double, 3>, kChannels> gain_{};
    Calibration calibration;
    std::unique_ptr<Decoupler> decoupler;
    std::uint64_t t_ns_ = 0;
    Estimate last;
    std::size_t samples_ = 0, good = 0, wrong = 0, named = 0, within = 0;
};

TEST_F(Redundant, AnUndamagedSensorRaisesNoAlarm) {
    ASSERT_FALSE(calibration.parity.sd.empty());
    run(100'000, [](auto&) {});
    EXPECT_GE(good, samples_ * 999 / 1000);
}

TEST_F(Redundant, AChannelThatSticksIsNamedAndReplacedWithATrueStandardDeviation) {
    for (std::size_t k = 0; k < kChannels; ++k) {
        run(1000, [](auto&) {});
        double stuck = kNaN;
        run(20'000, [&](auto& channel) {
            if (std::isnan(stuck)) stuck = channel[k];
            channel[k] = stuck;
        });
        EXPECT_LE(wrong, samples_ / 100) << k;
        EXPECT_GE(named, samples_ * 8 / 10) << k;
        EXPECT_GE(within, named * 9 / 10) << k;
        EXPECT_EQ(last.reasons & TACTILED_DISAGREEMENT, unsigned(TACTILED_DISAGREEMENT)) << k;
        run(1000, [](auto&) {});
        EXPECT_EQ(last.quality(), TACTILED_GOOD) << k;  // it works again
    }
}

TEST_F(Redundant, HalfGainIsNotGoodAndWrong) {
    for (std::size_t k = 0; k < kChannels; ++k) {
        run(10'000, [&](auto& channel) { channel[k] /= 2; });
        EXPECT_LE(wrong, samples_ / 100) << k;
        run(1000, [](auto&) {});
    }
}

TEST_F(Redundant, TwoDamagedChannelsHaveNoStandardDeviation) {
    run(5'000, [](auto& channel) { channel[0] = 0.3, channel[3] = -0.4; });
    EXPECT_LE(wrong, samples_ / 100);
    EXPECT_EQ(last.quality(), TACTILED_UNCERTAIN);
    EXPECT_NE(last.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);
    EXPECT_TRUE(std::isnan(last.sd[2]));
}

TEST_F(Redundant, AMissingChannelIsLeftToTheMethod) {
    std::vector<double> channel = reading(random_load());
    channel[1] = kNaN;
    EXPECT_EQ(decouple(*decoupler, channel, 2).quality(), TACTILED_BAD);
}

// A load that the rows do not cover curves the channels more than their predictions: outside the domain, and not a damage.
TEST_F(Redundant, ALoadBeyondTheRowsIsOutsideTheDomainAndNotADisagreement) {
    for (int i = 0; i < 100; ++i) {
        const std::vector<double> channel = reading({2.5, -2.5, -4, kNaN, kNaN, kNaN});
        last = decoupler->decouple({.channel = channel, .t_ns = t_ns_ += 1'000'000});
        EXPECT_EQ(last.reasons, unsigned(TACTILED_OUTSIDE_DOMAIN));
        EXPECT_TRUE(std::isfinite(last.sd[2]));
    }
    run(1000, [](auto&) {});
    EXPECT_EQ(good, samples_);
}

TEST_F(Redundant, AResidualThatMovesNoForceByItsStandardDeviationRaisesNoAlarm) {
    ASSERT_EQ(calibration.parity_harmless.size(), kChannels);
    const auto moved = [this](std::size_t k, double by) {
        run(3000, [&](auto& channel) { channel[k] += by; });
        const std::size_t share = good * 100 / samples_;
        run(1000, [](auto&) {});
        return share;
    };
    const auto& sd = calibration.parity.sd;
    calibration.parity_harmless.assign(kChannels, 20 * sd[0]);
    decoupler = make_decoupler(calibration);
    EXPECT_EQ(moved(0, 10 * sd[0]), 100u);
    EXPECT_LT(moved(0, 30 * sd[0]), 5u);
    calibration.parity_harmless.clear();  // a file without it
    decoupler = make_decoupler(calibration);
    EXPECT_LT(moved(0, 10 * sd[0]), 5u);
}

TEST_F(Redundant, WhatIsHarmlessFollowsFromTheStatedStandardDeviation) {
    for (std::size_t k = 0; k < kChannels; ++k) {
        std::array<double, 3> squares{};
        for (int i = 0; i < 400; ++i) {
            std::vector<double> channel = reading(random_load());
            const Estimate before = make_decoupler(calibration)->decouple({.channel = channel, .t_ns = 1});
            channel[k] += calibration.parity_harmless[k];
            const Estimate after = make_decoupler(calibration)->decouple({.channel = channel, .t_ns = 1});
            for (std::size_t c = 0; c < 3; ++c)
                squares[c] += std::pow((after.wrench_S[c] - before.wrench_S[c]) / before.sd[c], 2) / 400;
        }
        EXPECT_NEAR(std::sqrt(*std::max_element(squares.begin(), squares.end())), 1, 0.25) << k;
    }
}

TEST_F(Redundant, ComesBackFromAFileToTheLastBit) {
    Problems problems;
    calibration.path = "c.toml";
    const Calibration loaded = parse_calibration(calibration_text(calibration), "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(loaded.parity.order, calibration.parity.order);
    EXPECT_EQ(loaded.parity.coefficients, calibration.parity.coefficients);
    EXPECT_EQ(loaded.parity.sd, calibration.parity.sd);
    EXPECT_EQ(loaded.parity.false_alarms, calibration.parity.false_alarms);
    EXPECT_EQ(loaded.parity_harmless, calibration.parity_harmless);
    EXPECT_EQ(loaded.sd_without, calibration.sd_without);
    Calibration other = calibration;
    other.parity.coefficients[2].pop_back();
    EXPECT_NE(refusal(other).find("parity"), std::string::npos);
}

// `n` channels of three forces, with noise.
Labelled of_three_forces(std::size_t n) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    Labelled labelled{.name = "made", .channels = {}, .sessions = {}, .rows = {}};
    for (std::size_t k = 0; k < n; ++k) labelled.channels.push_back("g" + std::to_string(k));
    for (std::size_t i = 0; i < 600; ++i) {
        LabelledRow row{.line = std::int64_t(i) + 2,
                        .channel = {},
                        .wrench_S = {normal(random), normal(random), normal(random), kNaN, kNaN, kNaN},
                        .session = 0,
                        .t_ns = (i + 1) * 1'000'000};
        for (std::size_t k = 0; k < n; ++k)
            row.channel.push_back((k < 3 ? row.wrench_S[k] : row.wrench_S[0] - row.wrench_S[1] + row.wrench_S[2]) +
                                  0.001 * normal(random));
        labelled.rows.push_back(std::move(row));
    }
    return labelled;
}

// Four channels of three forces: the residual could be that of any of them.
TEST(Parity, ChannelsThatCannotBeDistinguishedAreNotReplacedAndTheStandardDeviationContainsTheDamageOfAny) {
    const auto calibration =
        fit(of_three_forces(4), {.model = "generic", .method = "matrix", .serial = "", .date = "", .parity = true})
            .calibration;
    ASSERT_EQ(calibration.parity.sd.size(), 4u);
    const Wrench load{0.2, 0.1, -0.3, kNaN, kNaN, kNaN};
    for (std::size_t damaged = 0; damaged < 4; ++damaged) {
        std::vector<double> channel{0.2, 0.1, -0.3, -0.2};
        const auto decoupler = make_decoupler(calibration);
        const double plain = decoupler->decouple({.channel = channel, .t_ns = 1}).sd[0];
        const Estimate right = decoupler->decouple({.channel = channel, .t_ns = 2});
        channel[damaged] += 0.2;
        const Estimate shifted = make_decoupler(calibration)->decouple({.channel = channel, .t_ns = 1});  // no alarm yet
        Estimate last;
        for (std::uint64_t i = 1; i < 100; ++i) last = decoupler->decouple({.channel = channel, .t_ns = i * 1'000'000});
        EXPECT_EQ(last.quality(), TACTILED_UNCERTAIN);
        EXPECT_NE(last.reasons & TACTILED_DISAGREEMENT, 0u);
        EXPECT_GT(last.sd[0], 5 * plain);
        EXPECT_EQ(last.wrench_S[0], shifted.wrench_S[0]);  // it is not replaced
        for (std::size_t c = 0; c < 3; ++c) {
            EXPECT_LE(std::abs(last.wrench_S[c] - load[c]), 2 * last.sd[c]) << damaged;
            EXPECT_NEAR(right.wrench_S[c], load[c], 5 * right.sd[c]);
        }
    }
}

// One group of rows in ten has a channel with another gain, as after another mounting.
TEST(Parity, IsLeftOutWithItsReasonWhereHeldOutRowsRaiseAnAlarm) {
    Labelled labelled = of_three_forces(5);
    Calibration calibration =
        fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = "", .parity = true}).calibration;
    ASSERT_FALSE(calibration.parity.sd.empty());
    Rows rows;
    std::vector<std::size_t> groups;
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        rows.push_back(&labelled.rows[i]);
        groups.push_back(i / 60);
    }
    std::vector<std::string> warnings;
    set_parity(rows, groups, calibration, warnings);
    EXPECT_FALSE(calibration.parity.sd.empty());
    EXPECT_EQ(calibration.parity.false_alarms, 0);
    EXPECT_EQ(warnings, std::vector<std::string>{});
    for (std::size_t i = 0; i < 60; ++i) labelled.rows[i].channel[4] *= 1.1;
    set_parity(rows, groups, calibration, warnings);
    EXPECT_TRUE(calibration.parity.sd.empty());
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_TRUE(warnings[0].starts_with("no parity: ")) << warnings[0];
}

TEST(Parity, IsFittedOnRequestOnly) {
    FitRequest request{.model = "generic", .method = "matrix", .serial = "", .date = ""};
    EXPECT_TRUE(fit(of_three_forces(5), request).calibration.parity.sd.empty());
    request.parity = true;
    EXPECT_FALSE(fit(of_three_forces(5), request).calibration.parity.sd.empty());
}

// Three channels of three forces: no channel follows from the others.
TEST(Parity, WithoutRedundancyNothingIsChecked) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    Labelled labelled{.name = "made", .channels = {"a", "b", "c"}, .sessions = {}, .rows = {}};
    for (std::size_t i = 0; i < 300; ++i) {
        const double x = normal(random), y = normal(random), z = normal(random);
        labelled.rows.push_back({.line = std::int64_t(i) + 2,
                                 .channel = {x + 0.1 * y, y - 0.2 * z, z},
                                 .wrench_S = {x, y, z, kNaN, kNaN, kNaN},
                                 .session = 0,
                                 .t_ns = (i + 1) * 1'000'000});
    }
    const auto calibration =
        fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = "", .parity = true}).calibration;
    EXPECT_TRUE(calibration.parity.sd.empty());
}

}  // namespace
}  // namespace tactiled
