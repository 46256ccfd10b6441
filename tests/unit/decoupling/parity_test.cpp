// Parity: a channel that disagrees with the others is found, named, and replaced by what they say.
#include "decoupling/parity.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

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
            if (last.quality == TACTILED_GOOD) {
                ++good;
                wrong += std::abs(error) > 5 * last.sd[2];
            } else if (last.quality == TACTILED_UNCERTAIN && std::isfinite(last.sd[2])) {
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
        EXPECT_EQ(last.quality, TACTILED_GOOD) << k;  // it works again
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
    EXPECT_EQ(last.quality, TACTILED_UNCERTAIN);
    EXPECT_NE(last.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);
    EXPECT_TRUE(std::isnan(last.sd[2]));
}

TEST_F(Redundant, AMissingChannelIsLeftToTheMethod) {
    std::vector<double> channel = reading(random_load());
    channel[1] = kNaN;
    EXPECT_EQ(decouple(*decoupler, channel, 2).quality, TACTILED_BAD);
}

TEST_F(Redundant, ComesBackFromAFileToTheLastBit) {
    Problems problems;
    calibration.path = "c.toml";
    const Calibration loaded = parse_calibration(calibration_text(calibration), "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(loaded.parity.order, calibration.parity.order);
    EXPECT_EQ(loaded.parity.coefficients, calibration.parity.coefficients);
    EXPECT_EQ(loaded.parity.sd, calibration.parity.sd);
    EXPECT_EQ(loaded.sd_without, calibration.sd_without);
    Calibration other = calibration;
    other.parity.coefficients[2].pop_back();
    EXPECT_NE(refusal(other).find("parity"), std::string::npos);
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
