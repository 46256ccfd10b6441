// The monitor: readings that no load causes are not GOOD, and readings that a load causes are.
//
// Ways in which this check could be wrong, each with a test below:
// 1. A damaged channel is GOOD and wrong, because the curvature of the sensor passes for free motion.
// 2. An undamaged later session, or loads together that came one by one, are outside.
// 3. Products or residuals that the rows do not support, or that cost time and find nothing.
// 4. The distance depends on the unit and the zero of a channel, or the loop computes another one than the file states.
// 5. Products of large numbers hide a reading, or the file of an older version loses its check.
#include "decoupling/monitor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "config/calibration.hpp"
#include "config/names.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/monitor_fit.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

bool is_inside(const Calibration& calibration, const std::vector<double>& channel) {
    return MonitorDistance(calibration.monitor).squared(channel.data()) <= 1;
}

const std::string kSkin = TACTILED_SOURCE_DIR "/tests/data/eflesh/normal_labelled.csv";

Labelled session(const std::string& name) { return read_labelled(kSkin, {.sessions = {name}, .channels = {}}); }

// ---- 1, 2. a real skin, fitted on session 1 and damaged in session 2
// ---------------------------------------------------------

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
    EXPECT_GT(calibration.monitor.limit, 0);
    EXPECT_LE(calibration.monitor.false_alarms, 0.005);
}

INSTANTIATE_TEST_SUITE_P(Eflesh, Skin, ::testing::Values("matrix", "quadratic"));

// ---- 1, 2. a load cell of six axes
// -------------------------------------------------------------------------------------------

// Eight channels, six components; each axis loaded alone, as with dead weights, at both signs.
class LoadCell : public ::testing::Test {
protected:
    LoadCell() {
        labelled.name = "made";
        labelled.sessions = {"1", "2", "3"};
        for (std::size_t k = 0; k < 8; ++k) labelled.channels.push_back("g" + std::to_string(k));
        for (auto& row : gain)
            for (double& value : row) value = normal(random);
        for (std::size_t repeat = 0; repeat < 3; ++repeat)
            for (std::size_t axis = 0; axis < 6; ++axis)
                for (const double load : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
                    Wrench wrench{};
                    wrench[axis] = 10 * load;
                    labelled.rows.push_back({.line = std::int64_t(labelled.rows.size()) + 2,
                                             .channel = reading(wrench),
                                             .wrench_S = wrench,
                                             .session = repeat,
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
    ASSERT_GT(calibration.monitor.limit, 0);
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
        good += is_inside(calibration, channel);
    }
    EXPECT_GT(total, 100);
    EXPECT_EQ(good, total);
}

// Averaged loads, and samples of one conversion each.
TEST_F(LoadCell, NoiseOfAQuarterOfAPercentOfTheRangeIsInside) {
    const auto calibration = fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = ""}).calibration;
    ASSERT_GT(calibration.monitor.limit, 0);
    int inside = 0, total = 0;
    for (int repeat = 0; repeat < 50; ++repeat)
        for (const auto& row : labelled.rows) {
            auto channel = row.channel;
            for (std::size_t k = 0; k < channel.size(); ++k)
                channel[k] += 0.0025 * (calibration.channel_most[k] - calibration.channel_least[k]) * normal(random);
            ++total;
            inside += is_inside(calibration, channel);
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

// Each of two groups needs 27 rows in the other one.
TEST_F(LoadCell, TooFewRowsHaveNoMonitor) {
    for (const std::size_t n : {std::size_t{50}, std::size_t{54}}) {
        Calibration calibration;
        calibration.channels = labelled.channels;
        calibration.components = {"fx", "fy", "fz", "mx", "my", "mz"};
        Rows rows = pointers(labelled.rows);
        rows.resize(n);
        std::vector<std::size_t> group(n);
        for (std::size_t i = 0; i < n; ++i) group[i] = 2 * i / n;
        set_monitor(rows, group, {}, calibration);
        EXPECT_EQ(calibration.monitor.limit > 0, n == 54) << n;
    }
}

// ---- photodiodes ----------------------------------------------------------------------------------------------------

constexpr std::size_t kDiodes = 10;
constexpr double kFull_N[3]{8, 8, 15};

// Photodiodes around a soft body: each one's current is an exponential function of a mixture of the components.
class Optical : public ::testing::Test {
protected:
    Optical() {
        for (std::size_t k = 0; k < kDiodes; ++k) {
            const double angle = 0.628 * double(k), side = 0.4 + 0.03 * double(k);
            gain_[k] = {side * std::cos(angle), side * std::sin(angle), -0.8 - 0.04 * double(k)};
        }
    }
    std::vector<double> reading(const Wrench& wrench_S, double noise = 3) {
        std::vector<double> channel(kDiodes);
        for (std::size_t k = 0; k < kDiodes; ++k) {
            double bend = 0;
            for (std::size_t c = 0; c < 3; ++c) bend += gain_[k][c] * wrench_S[c] / kFull_N[c];
            channel[k] = 1000 * std::exp(curvature_ * bend) + noise * normal_(random_);
        }
        return channel;
    }
    // A press with shear, up to full scale; 0 .. 1.
    Wrench load(double press) {
        const auto part = [&] { return std::uniform_real_distribution<double>(-0.8, 0.8)(random_); };
        return {kFull_N[0] * part() * press, kFull_N[1] * part() * press, -kFull_N[2] * press, kNaN, kNaN, kNaN};
    }
    // `sessions` sessions of 400 rows: a load that goes up and down.
    Labelled record(std::size_t sessions) {
        Labelled labelled;
        labelled.name = "made";
        for (std::size_t k = 0; k < kDiodes; ++k) labelled.channels.push_back("o" + std::to_string(k));
        for (std::size_t s = 0; s < sessions; ++s) {
            labelled.sessions.push_back(std::to_string(s + 1));
            for (std::size_t i = 0; i < 400; ++i) {
                const Wrench wrench = load(std::abs(std::sin(0.37 * double(i))));
                labelled.rows.push_back({.line = std::int64_t(labelled.rows.size()) + 2,
                                         .channel = reading(wrench),
                                         .wrench_S = wrench,
                                         .session = s,
                                         .t_ns = (s * 10'000 + i) * 100'000'000});
            }
        }
        return labelled;
    }
    static Calibration calibrated(const Labelled& labelled) {
        return fit(labelled, {.model = "generic", .method = "matrix", .serial = "", .date = ""}).calibration;
    }

    double curvature_ = 0.9;
    std::array<std::array<double, 3>, kDiodes> gain_{};
    std::mt19937 random_{5};
    std::normal_distribution<double> normal_;
};

// ---- 1. damage ---------------------------------------------------------------------------------------------------------

TEST_F(Optical, ADamagedDiodeIsNotGoodAndWrong) {
    const Calibration calibration = calibrated(record(3));
    ASSERT_FALSE(calibration.monitor.product_mean.empty());
    Calibration flat = calibration;
    flat.monitor = {};
    const auto decoupler = make_decoupler(calibration), without = make_decoupler(flat);
    const std::vector<double> rest = reading({0, 0, 0}, 0);
    int samples = 0, wrong = 0, wrong_without = 0;
    for (int i = 0; i < 400; ++i) {
        const Wrench wrench = load(std::uniform_real_distribution<double>(0.2, 1)(random_));
        const std::vector<double> sound = reading(wrench);
        for (std::size_t k = 0; k < kDiodes; ++k)
            for (const double gain : {0.0, 0.5, -1.0}) {
                std::vector<double> channel = sound;
                channel[k] = rest[k] + gain * (sound[k] - rest[k]);
                const auto is_wrong = [&](Decoupler& judge) {
                    const Estimate estimate = decouple(judge, channel);
                    bool is_off = false;
                    for (std::size_t c = 0; c < 3; ++c)
                        is_off = is_off || std::abs(estimate.wrench_S[c] - wrench[c]) > 0.1 * kFull_N[c];
                    return is_off && estimate.quality() == TACTILED_GOOD;
                };
                ++samples;
                wrong += is_wrong(*decoupler);
                wrong_without += is_wrong(*without);
            }
    }
    EXPECT_LE(wrong, samples / 1000);
    EXPECT_GE(wrong_without, samples / 200) << "the case shows nothing";
}

// ---- 2. what is not damaged ----------------------------------------------------------------------------------------------

TEST_F(Optical, ALaterSessionIsInside) {
    const Calibration calibration = calibrated(record(3));
    ASSERT_FALSE(calibration.monitor.product_mean.empty());
    EXPECT_LE(calibration.monitor.false_alarms, 0.005);
    int inside = 0;
    for (int i = 0; i < 2000; ++i) inside += is_inside(calibration, reading(load(0.0005 * i)));
    EXPECT_GE(inside, 1998);
}

// Sessions that begin with zeros of their own show how far the zero of the next one may be.
TEST_F(Optical, ASessionWithAnotherZeroIsInside) {
    Labelled labelled = record(4);
    const auto zeros = [&] {
        std::vector<double> zero(kDiodes);
        for (double& each : zero) each = 40 * normal_(random_);
        return zero;
    };
    std::vector<double> zero;
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        if (i % 400 == 0) zero = zeros();
        for (std::size_t k = 0; k < kDiodes; ++k) labelled.rows[i].channel[k] += zero[k];
    }
    const Calibration calibration = calibrated(labelled);
    int inside = 0;
    for (int session = 0; session < 20; ++session) {
        zero = zeros();
        for (int i = 0; i < 100; ++i) {
            std::vector<double> channel = reading(load(0.01 * i));
            for (std::size_t k = 0; k < kDiodes; ++k) channel[k] += zero[k];
            inside += is_inside(calibration, channel);
        }
    }
    EXPECT_GE(inside, 1980);
}

// Two sessions show two directions in which gains may differ, and the next one differs in others.
TEST_F(Optical, AThirdSessionWithOtherGainsIsInside) {
    std::vector<double> gain(kDiodes);
    const auto next_gains = [&] {
        for (double& each : gain) each = 1 + 0.02 * normal_(random_);
    };
    const auto with_gains = [&](std::vector<double> channel) {
        for (std::size_t k = 0; k < kDiodes; ++k) channel[k] = 1000 + gain[k] * (channel[k] - 1000);
        return channel;
    };
    Labelled labelled = record(2);
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        if (i % 400 == 0) next_gains();
        labelled.rows[i].channel = with_gains(labelled.rows[i].channel);
    }
    const Calibration calibration = calibrated(labelled);
    ASSERT_FALSE(calibration.monitor.product_mean.empty());
    int inside = 0;
    for (int session = 0; session < 20; ++session) {
        next_gains();
        for (int i = 0; i < 100; ++i) inside += is_inside(calibration, with_gains(reading(load(0.01 * i))));
    }
    EXPECT_GE(inside, 1980);
}

TEST_F(Optical, LoadsThatCameOneByOneMayComeTogether) {
    Labelled labelled = record(3);
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        auto& row = labelled.rows[i];
        for (std::size_t c = 0; c < 3; ++c)
            if (c != i / 5 % 3) row.wrench_S[c] = 0;
        row.channel = reading(row.wrench_S);
    }
    const Calibration calibration = calibrated(labelled);
    int inside = 0;
    for (int i = 0; i < 2000; ++i) inside += is_inside(calibration, reading(load(0.0005 * i)));
    EXPECT_GE(inside, 1980);
}

// ---- 3. what the rows support ------------------------------------------------------------------------------------------

TEST_F(Optical, ALinearSensorHasNoProducts) {
    curvature_ = 0.005;
    Labelled labelled = record(3);
    for (auto& row : labelled.rows) row.channel = reading(row.wrench_S, 0.02);
    const Calibration calibration = calibrated(labelled);
    EXPECT_FALSE(calibration.monitor.residual.empty());
    EXPECT_TRUE(calibration.monitor.product_mean.empty());
}

// With as many channels as components each reading is one that some load causes.
TEST_F(Optical, AsManyChannelsAsComponentsHaveNoResidual) {
    Labelled labelled = record(3);
    labelled.channels.resize(3);
    for (auto& row : labelled.rows) row.channel = {row.channel[0], row.channel[3], row.channel[7]};
    const Calibration calibration = calibrated(labelled);
    EXPECT_GT(calibration.monitor.limit, 0);
    EXPECT_TRUE(calibration.monitor.residual.empty());
}

// 24 loads are enough for the matrix of five channels, but not for nine features, however often each load is repeated.
TEST_F(Optical, TooFewLoadsHaveNoProducts) {
    Labelled labelled = record(1);
    labelled.channels.resize(5);
    for (std::size_t i = 0; i < labelled.rows.size(); ++i) {
        auto& row = labelled.rows[i];
        if (i % 16 != 0) row.wrench_S = labelled.rows[i / 16 * 16].wrench_S;
        const std::vector<double> all = reading(row.wrench_S);
        row.channel = {all[0], all[2], all[4], all[6], all[8]};
    }
    labelled.rows.resize(24 * 16);
    EXPECT_TRUE(calibrated(labelled).monitor.product_mean.empty());
}

// ---- 4. one distance -----------------------------------------------------------------------------------------------------

TEST_F(Optical, TheUnitOfAChannelDoesNotMatter) {
    Labelled labelled = record(3);
    const Calibration calibration = calibrated(labelled);
    const auto other = [](std::vector<double> channel) {
        for (std::size_t k = 0; k < kDiodes; ++k) channel[k] = 1e-6 * std::pow(10, double(k % 4)) * (channel[k] + 3e4);
        return channel;
    };
    for (auto& row : labelled.rows) row.channel = other(row.channel);
    const Calibration scaled = calibrated(labelled);
    ASSERT_GT(scaled.monitor.limit, 0);
    const MonitorDistance distance(calibration.monitor), distance_scaled(scaled.monitor);
    for (int i = 0; i < 50; ++i) {
        std::vector<double> channel = reading(load(0.02 * i));
        channel[std::size_t(i) % kDiodes] *= 0.8;
        const double expected = distance.squared(channel.data());
        EXPECT_NEAR(distance_scaled.squared(other(channel).data()), expected, 1e-3 * expected);
    }
}

// Two channels on the parabola b = a^2: t = a, p = t^2 - 1, and the residual is b - 1 - p, whitened by 20.
Calibration by_hand() {
    Calibration calibration;
    calibration.path = "c.toml";
    calibration.model = "generic";
    calibration.contact_model = "unknown";
    calibration.method = "matrix";
    calibration.channels = {"a", "b"};
    calibration.zero = {0, 0};
    calibration.components = {"fz"};
    calibration.matrix = {{1, 1}};
    calibration.sd = {0.5};
    calibration.monitor = {.mean = {0, 1},
                           .scores = {{1, 0}},
                           .limit = 20,
                           .residual = {{0, 20}},
                           .residual_limit = 4,
                           .product_mean = {1},
                           .coefficients = {{20}},
                           .product_whitening = {{1}},
                           .false_alarms = 0.001};
    return calibration;
}

TEST(Monitor, IsThatOfTheFile) {
    const MonitorDistance distance(by_hand().monitor);
    const auto squared = [&](const std::vector<double>& channel) { return distance.squared(channel.data()); };
    EXPECT_NEAR(squared({2, 4}), 4.0 / 400, 1e-12);
    // b is off by 1: |e| = 20; t = 2 and p = 3, so that the variance grows by 1 + 13 / 2.
    EXPECT_NEAR(squared({2, 5}), 400.0 / 16 / 7.5, 1e-12);
    EXPECT_NEAR(squared({0, 0}), 0, 1e-12);
    EXPECT_NEAR(squared({0, 1}), 400.0 / 16 / 1.5, 1e-12);
    EXPECT_NEAR(squared({40, 1600}), 4, 1e-12) << "on the curve, but far from the rows";
}

TEST(Monitor, TheStandardDeviationGrowsWithTheLargerDistance) {
    const auto decoupler = make_decoupler(by_hand());
    const Estimate inside = decouple(*decoupler, {2, 4});
    EXPECT_EQ(inside.quality(), TACTILED_GOOD);
    EXPECT_EQ(inside.sd[2], 0.5);
    const Estimate outside = decouple(*decoupler, {2, 5});
    EXPECT_EQ(outside.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(outside.reasons, TACTILED_OUTSIDE_DOMAIN);
    EXPECT_NEAR(outside.sd[2], 0.5 * std::sqrt(400.0 / 16 / 7.5), 1e-12);
    EXPECT_EQ(outside.wrench_S[2], 7);
    EXPECT_NEAR(decouple(*decoupler, {40, 1600}).sd[2], 0.5 * 2, 1e-12);
}

TEST(Monitor, ServesEachMethodOfAuto) {
    Calibration calibration = by_hand();
    calibration.channel_least = {-100, -100};
    calibration.channel_most = {100, 100};
    const auto decoupler = make_decoupler(calibration, "auto", 1000);
    EXPECT_EQ(decouple(*decoupler, {2, 5}).quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(decouple(*decoupler, {2, 4}).quality(), TACTILED_GOOD);
}

// Each number of channels and scores has its own padding.
TEST(Monitor, OfAnySizeIsItsFormula) {
    std::mt19937 random(8);
    std::normal_distribution<double> normal;
    for (std::size_t n = 1; n <= kMaxChannels; ++n)
        for (const bool with_products : {false, true}) {
            const std::size_t m = std::min<std::size_t>(1 + n % kMaxScores, n);
            Monitor monitor;
            monitor.limit = 3;
            const auto row = [&](std::size_t size) {
                std::vector<double> numbers(size);
                for (double& number : numbers) number = normal(random);
                return numbers;
            };
            monitor.mean = row(n);
            for (std::size_t i = 0; i < m; ++i) monitor.scores.push_back(row(n));
            for (std::size_t i = m; i < n; ++i) monitor.residual.push_back(row(n));
            if (n > m) monitor.residual_limit = 2;
            if (n > m && with_products) {
                monitor.product_mean = row(products_of(m));
                for (std::size_t i = m; i < n; ++i) monitor.coefficients.push_back(row(products_of(m)));
                for (std::size_t f = 0; f < products_of(m); ++f) monitor.product_whitening.push_back(row(f + 1));
            }
            const std::vector<double> channel = row(n);
            const auto dot = [](const std::vector<double>& a, const std::vector<double>& b) {
                double sum = 0;
                for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
                return sum;
            };
            std::vector<double> z = channel, t, p;
            for (std::size_t k = 0; k < n; ++k) z[k] -= monitor.mean[k];
            for (const auto& score : monitor.scores) t.push_back(dot(score, z));
            for (std::size_t i = 0; i < m && !monitor.product_mean.empty(); ++i)
                for (std::size_t j = i; j < m; ++j) p.push_back(t[i] * t[j] - monitor.product_mean[p.size()]);
            double of_features = dot(t, t), of_residual = 0;
            for (const auto& whitening : monitor.product_whitening) of_features += std::pow(dot(whitening, p), 2);
            for (std::size_t i = 0; i < monitor.residual.size(); ++i)
                of_residual += std::pow(dot(monitor.residual[i], z) - (p.empty() ? 0 : dot(monitor.coefficients[i], p)), 2);
            double expected = dot(t, t) / 9;
            if (n > m) expected = std::max(expected, of_residual / 4 / (1 + of_features / double(m + p.size())));
            EXPECT_NEAR(MonitorDistance(monitor).squared(channel.data()), expected, 1e-9 * expected)
                << n << " channels, " << m << " scores";
        }
}

// ---- 5. extremes and the file --------------------------------------------------------------------------------------------

TEST(Monitor, AnyBitsAreNotGoodAndHaveAFiniteStandardDeviation) {
    const auto decoupler = make_decoupler(by_hand());
    for (const double odd : {1e100, 1e160, 1e300, -1e300, std::numeric_limits<double>::infinity(), kNaN})
        for (const std::vector<double>& channel : {std::vector<double>{odd, 1}, {0, odd}, {odd, odd}}) {
            const Estimate estimate = decouple(*decoupler, channel);
            EXPECT_NE(estimate.quality(), TACTILED_GOOD) << odd;
            if (estimate.quality() == TACTILED_UNCERTAIN) { EXPECT_TRUE(std::isfinite(estimate.sd[2])) << odd; }
        }
    EXPECT_EQ(decouple(*decoupler, {0, kNaN}, 2).quality(), TACTILED_BAD);
}

TEST(Monitor, ComesBackToTheLastBit) {
    Problems problems;
    const std::string text = calibration_text(by_hand());
    const Calibration loaded = parse_calibration(text, "c.toml", problems);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(calibration_text(loaded), text);
    EXPECT_EQ(loaded.monitor.residual_limit, 4);
    EXPECT_FALSE(loaded.monitor.is_older);
}

// Version 0.1.0 wrote the joint domain, its curved part and the parity of channels.
TEST(Monitor, OfAnOlderFileIsItsJointDomain) {
    Calibration plain = by_hand();
    plain.monitor = {};
    std::string text = calibration_text(plain);
    text.resize(text.rfind("crc"));
    text.insert(text.find("components"),
                "joint_domain.mean = [1.0, 1.0]\njoint_domain.whitening = [\n    [1.0],\n    [-10.0, 10.0],\n]\n"
                "joint_domain.limit = 2.0\njoint_domain.false_alarms = 0.0\njoint_domain.curved.limit = 4.0\n"
                "joint_domain.curved.directions = [\n    [1.0, 0.0],\n]\nparity.order = 1\nparity.sd = [0.1, 0.1]\n"
                "sd_without = [\n    [0.1],\n    [0.2],\n]\nparity_harmless = [0.1, 0.2]\n");
    Problems problems;
    const Calibration loaded = parse_calibration(text, "c.toml", problems);
    ASSERT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_TRUE(loaded.monitor.is_older);
    const auto decoupler = make_decoupler(loaded);
    EXPECT_EQ(decouple(*decoupler, {2, 2}).quality(), TACTILED_GOOD);
    const Estimate outside = decouple(*decoupler, {1, 2});  // d = 10
    EXPECT_EQ(outside.reasons, TACTILED_OUTSIDE_DOMAIN);
    EXPECT_NEAR(outside.sd[2], 0.5 * 10 / 2, 1e-12);
}

TEST(Monitor, OfAWrongShapeIsRefused) {
    for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
             {"monitor.mean = [0.0, 1.0]", "monitor.mean = [0.0]"},
             {"monitor.limit = 20.0", "monitor.limit = 0.0"},
             {"monitor.limit = 20.0", "monitor.limit = nan"},
             {"scores = [\n    [1.0, 0.0],\n]", "scores = [\n    [1.0],\n]"},
             {"scores = [\n    [1.0, 0.0],\n]", "scores = [\n    [1.0, 0.0],\n    [0.0, 1.0],\n]"},
             {"residual = [\n    [0.0, 20.0],\n]", "residual = [\n    [20.0],\n]"},
             {"residual_limit = 4.0", "residual_limit = -1.0"},
             {"coefficients = [\n    [20.0],\n]", "coefficients = [\n    [20.0, 1.0],\n]"},
             {"product_whitening = [\n    [1.0],\n]", "product_whitening = [\n    [1.0, 1.0],\n]"}}) {
        const auto problems = problems_of(by_hand(), from, to);
        ASSERT_GE(problems.size(), 1u) << to;
        EXPECT_NE(problems.front().find("monitor"), std::string::npos) << problems.front();
    }
    const auto spoil = [](auto change) {
        Calibration calibration = by_hand();
        change(calibration.monitor);
        return refusal(calibration);
    };
    EXPECT_NE(spoil([](Monitor& m) { m.scores.clear(); }).find("monitor"), std::string::npos);
    EXPECT_NE(spoil([](Monitor& m) { m.residual[0].pop_back(); }).find("monitor"), std::string::npos);
    EXPECT_NE(spoil([](Monitor& m) { m.residual_limit = 0; }).find("monitor"), std::string::npos);
    EXPECT_NE(spoil([](Monitor& m) { m.coefficients.clear(); }).find("monitor"), std::string::npos);
    EXPECT_NE(spoil([](Monitor& m) { m.product_whitening[0].clear(); }).find("monitor"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
