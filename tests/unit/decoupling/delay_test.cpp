// How long readings lag behind the force, measured on readings whose lag is known.
#include "decoupling/fit/delay.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "decoupling/fit/least_squares.hpp"

namespace tactiled {
namespace {

Calibration straight() {
    Calibration calibration;
    calibration.path = "straight.toml";
    calibration.model = "generic";
    calibration.method = "matrix";
    calibration.channels = {"A", "B"};
    calibration.components = {"fx", "fz"};
    calibration.full_scale = {2, 10};
    calibration.zero = {0, 0};
    calibration.matrix = {{1, 0}, {0, 1}};
    return calibration;
}

struct Made {
    double delay_s = 0, hysteresis = 0, gain = 1, noise_N = 2e-3, rate_Hz = 1000, speed = 1;
    int rows = 4000;
};

// A press that is never below 2 N, of three frequencies, and a shear of two.
double press_N(double t_s) {
    const double w = 2 * std::numbers::pi * t_s;
    return -5 + 2 * std::sin(1.3 * w) + std::sin(4.1 * w) - 0.5 * std::sin(11 * w);
}
double shear_N(double t_s) {
    const double w = 2 * std::numbers::pi * t_s;
    return std::sin(0.9 * w) + 0.4 * std::sin(7 * w);
}

// With a loop as wide as hysteresis x full scale: a play.
Labelled made(const Made& of, double (*press)(double) = press_N, double (*shear)(double) = shear_N) {
    Labelled all;
    all.name = "made.csv";
    all.channels = {"B", "A"};  // not in the calibration's order
    std::mt19937_64 random(7);
    std::normal_distribution<double> noise(0, of.noise_N);
    double held[2] = {shear(0), press(0)};
    const double half[2] = {of.hysteresis * 2 / 2, of.hysteresis * 10 / 2};
    for (int i = 0; i < of.rows; ++i) {
        const double t_s = 10 + i / of.rate_Hz,
                     now[2] = {shear(of.speed * (t_s - of.delay_s)), press(of.speed * (t_s - of.delay_s))};
        for (int c = 0; c < 2; ++c) held[c] = std::clamp(held[c], now[c] - half[c], now[c] + half[c]);
        LabelledRow row{
            .line = i + 2, .channel = {}, .wrench_S = kUnseen, .session = 0, .t_ns = std::uint64_t(std::llround(t_s * 1e9))};
        row.channel = {of.gain * held[1] + noise(random), of.gain * held[0] + noise(random)};
        row.wrench_S[0] = shear(of.speed * t_s);
        row.wrench_S[2] = press(of.speed * t_s);
        all.rows.push_back(row);
    }
    return all;
}

std::string refusal(const Labelled& rows) {
    try {
        const Delay delay = measure_delay(straight(), rows);
        return "not refused: " + std::to_string(delay.delay_s);
    } catch (const Undetermined& error) { return error.what(); }
}

TEST(Delay, IsFoundFromAFractionOfARowToManyRows) {
    for (const double delay_s : {0.2e-3, 0.6e-3, 8.4e-3, 84e-3, 0.35, 0.6, 0.9}) {
        const Delay found = measure_delay(straight(), made({.delay_s = delay_s}));
        EXPECT_NEAR(found.delay_s, delay_s, 5 * found.sd_s + 1e-6) << delay_s;
        EXPECT_LT(found.sd_s, 2e-5);
        EXPECT_GT(found.rows, 4000u);
    }
}

// As a loading machine goes from load to load: what is on the way is over before the first reading of it comes.
TEST(Delay, IsFoundThoughItIsLongerThanWhatMoves) {
    const auto steps = [](double least, double most, int salt) {
        return [=](double t_s) {
            const auto load = [&](double i) {
                return least + (most - least) * std::abs(std::fmod(std::sin(i * 12.9898 + salt) * 43758.5453, 1));
            };
            const double at = std::floor(t_s / 0.3), share = std::min(1.0, (t_s - 0.3 * at) / 0.05);
            return load(at - 1) + share * (load(at) - load(at - 1));
        };
    };
    static const auto press = steps(-9, -1, 1), shear = steps(-1.5, 1.5, 3);
    for (const double delay_s : {84e-3, 0.2, 0.27}) {
        const auto rows = made(
            {.delay_s = delay_s, .rows = 12000}, [](double t_s) { return press(t_s); },
            [](double t_s) { return shear(t_s); });
        EXPECT_NEAR(measure_delay(straight(), rows).delay_s, delay_s, 0.1e-3);
    }
}

// Between two rows, 20 ms apart.
TEST(Delay, IsFoundBetweenRows) {
    for (const double delay_s : {3e-3, 9e-3, 31e-3})
        EXPECT_NEAR(measure_delay(straight(), made({.delay_s = delay_s, .rate_Hz = 50, .speed = 0.5})).delay_s, delay_s,
                    0.1e-3);
}

TEST(Delay, IsNotWhatAWrongGainOrAZeroMakes) {
    Labelled rows = made({.delay_s = 3e-3, .gain = 1.04});
    for (LabelledRow& row : rows.rows) row.channel[0] += 0.3;
    EXPECT_NEAR(measure_delay(straight(), rows).delay_s, 3e-3, 0.05e-3);
}

// A loop of 2 % at these speeds would pass for 4 ms.
TEST(Delay, IsNotWhatHysteresisMakes) {
    EXPECT_LT(measure_delay(straight(), made({.hysteresis = 0.02})).delay_s, 0.4e-3);
    EXPECT_NEAR(measure_delay(straight(), made({.delay_s = 5e-3, .hysteresis = 0.02})).delay_s, 5e-3, 0.5e-3);
}

TEST(Delay, IsNotMovedBySpikes) {
    Labelled rows = made({.delay_s = 2e-3});
    for (std::size_t i = 0; i < rows.rows.size(); i += 97) rows.rows[i].channel[i % 2] += 20;
    EXPECT_NEAR(measure_delay(straight(), rows).delay_s, 2e-3, 0.02e-3);
}

TEST(Delay, ThatCannotBeToldFromNoneIsNone) {
    const Delay found = measure_delay(straight(), made({.noise_N = 0.2, .rows = 1000}));
    EXPECT_EQ(found.delay_s, 0);
    EXPECT_GT(found.sd_s, 0.05e-3);
}

TEST(Delay, IsFoundInSeveralSessionsWhoseTimesBeginAnew) {
    Labelled rows = made({.delay_s = 4e-3, .rows = 2000});
    rows.sessions = {"one", "two"};
    const std::size_t n = rows.rows.size();
    for (std::size_t i = 0; i < n; ++i) {
        rows.rows.push_back(rows.rows[i]);
        rows.rows.back().session = 1;
    }
    EXPECT_NEAR(measure_delay(straight(), rows).delay_s, 4e-3, 0.05e-3);
}

TEST(Delay, IsRefusedWhereRowsDoNotTell) {
    const auto still = [](double) { return -5.0; };
    EXPECT_NE(refusal(made({}, still, still)).find("the force changes in 0 rows"), std::string::npos);
    const auto saw = [](double t_s) { return std::abs(std::remainder(t_s, 1)) * 8 - 6; };
    EXPECT_NE(refusal(made({.delay_s = 1e-3, .hysteresis = 0.02}, saw, still)).find("at one speed alone"),
              std::string::npos);
    EXPECT_NE(refusal(made({.delay_s = -5e-3})).find("the labels are 5"), std::string::npos);
    Labelled timeless = made({});
    for (LabelledRow& row : timeless.rows) row.t_ns = 0;
    EXPECT_NE(refusal(timeless).find("needs t_s"), std::string::npos);
    Labelled other = made({});
    other.channels = {"A", "C"};
    EXPECT_NE(refusal(other).find("no channel \"B\""), std::string::npos);
}

}  // namespace
}  // namespace tactiled
