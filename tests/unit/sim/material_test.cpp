// The response of the skin to a load, against closed forms and figures of the documents and of finite elements.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/unit/sim/effects_at_work.hpp"

namespace tactiled::sim {
namespace {

TEST(LargeDeflection, OfAPadObeysTheNeoHookeanLaw) {
    AtWork pad("capacitive", {"large_deflection"}, "strain_per_N = 0.03\ncentre_pF = 2");
    for (const double N : {1e-6, 0.1, 1.0, 10.0, 100.0, -1.0, -20.0}) {
        const double stretch = 1 + 0.03 * pad(press(N)).drive[kFz];
        EXPECT_NEAR((1 / (stretch * stretch) - stretch) / 3, 0.03 * N, 1e-12 * (1 + N * N)) << N;
    }
}

TEST(LargeDeflection, OfHairsFollowsTheElastomersStrain) {
    AtWork hair("hair", {"large_deflection"}, "young_Pa = 150e3\narea_m2 = 1e-5");
    const double q = 0.05 / (150e3 * 1e-5), stretch = 1 + hair(press(0.05)).drive[kFz] / (150e3 * 1e-5);
    EXPECT_NEAR((1 / (stretch * stretch) - stretch) / 3, q, 1e-14);
}

TEST(LargeDeflection, OfThePlateIsThatOfTheFiniteElements) {
    AtWork table("table", {"large_deflection"});
    EXPECT_NEAR(table(press(1)).drive[kFz], -(1 - 0.046), 0.001);
    EXPECT_NEAR(table(press(5)).drive[kFz], -5 * (1 - 0.25), 0.01);
    EXPECT_EQ(table({.load = {1, -2, 0, 0, 0}}).drive[kFx], 1);
}

// Finite elements of a pad of 12 mm by 3 mm, bonded on both faces: cap_curves.csv.
TEST(BondedLayer, WithLargeDeflectionIsThatOfTheFiniteElements) {
    AtWork pad("capacitive", {"bonded_layer", "large_deflection"}, "strain_per_N = 0.03297765\ngap_m = 3e-3");
    const auto stroke_mm = [&](double N) { return -3 * 0.03297765 * pad(press(N)).drive[kFz]; };
    EXPECT_NEAR(stroke_mm(1), 0.09563188, 0.01 * 0.0956);
    EXPECT_NEAR(stroke_mm(5), 0.41327769, 0.01 * 0.413);
    EXPECT_NEAR(stroke_mm(9.5), 0.68422521, 0.01 * 0.684);
}

TEST(BondedLayer, SolvesItsLaw) {
    AtWork pad("capacitive", {"bonded_layer", "large_deflection"}, "strain_per_N = 0.03\ncentre_pF = 2");
    for (const double N : {0.1, 1.0, 10.0, 20.0}) {
        const double c = 1 / (1 + 0.03 * pad(press(N)).drive[kFz]);
        EXPECT_NEAR((c * c - 1 / c) / 3 / 0.03 * std::pow(c, 0.14), N, 2e-3 * N) << N;
    }
}

TEST(Softening, ReadsMoreBelowTheLargestLoadSoFar) {
    AtWork pad("capacitive", {"softening"}, "", "[effects.softening]\namount = 0.1\n");
    EXPECT_EQ(pad(press(2)).drive[kFz], -2);  // the first loading
    EXPECT_EQ(pad(press(4)).drive[kFz], -4);
    EXPECT_NEAR(pad(press(2)).drive[kFz], -2 * 1.05, 1e-15);
    EXPECT_NEAR(pad(press(4)).drive[kFz], -4, 1e-15);
    EXPECT_EQ(pad(press(8)).drive[kFz], -8);
}

TEST(Hysteresis, OfTheTableIs4Point84PercentOfFullScale) {
    AtWork table("table", {"hysteresis"});
    std::vector<Moment> cycle;
    for (int i = 0; i <= 2000; ++i) cycle.push_back(press((i <= 1000 ? i : 2000 - i) * 1e-3));
    const auto r = table.run(cycle);
    double widest = 0;
    for (std::size_t i = 0; i <= 1000; ++i) {
        EXPECT_NEAR(r[i].drive[kFz], cycle[i].load[kFz], 1e-15);  // it appears only during unloading
        widest = std::max(widest, r[i].drive[kFz] - r[2000 - i].drive[kFz]);
    }
    EXPECT_NEAR(widest, 0.0484, 1e-9);
    EXPECT_NEAR(r[1000].drive[kFz], -1, 1e-15);
}

TEST(Hysteresis, DoesNotHangOnTheRateAndForgetsASmallerLoop) {
    AtWork slow("table", {"hysteresis"}), fast("table", {"hysteresis"});
    std::vector<Moment> steps;
    for (int i = 0; i <= 800; ++i) steps.push_back(press(1e-3 * i));
    for (int i = 800; i >= 300; --i) steps.push_back(press(1e-3 * i));
    for (int i = 300; i <= 600; ++i) steps.push_back(press(1e-3 * i));
    for (int i = 600; i >= 300; --i) steps.push_back(press(1e-3 * i));
    const double after = slow.run(steps).back().drive[kFz];
    EXPECT_NEAR(after, fast.run({press(0.8), press(0.3)}).back().drive[kFz], 1e-12);
    EXPECT_LT(after, -0.3 - 0.005);  // and reads more than 0.3 N
}

TEST(DomeResonance, AnswersASineLikeASecondOrderSystem) {
    const double rate = 100e3, f0 = 1100, z = 0.25, delay = 0.5e-3;
    for (const double f : {50.0, 500.0, 1100.0, 3000.0}) {
        AtWork dome("capacitive", {"dome_resonance"}, "",
                    "[effects.dome_resonance]\nresonance_Hz = 1100\ndamping = 0.25\ndelay_s = 0.5e-3\n", rate);
        std::vector<Moment> moments;
        const double w = 2 * std::numbers::pi * f;
        const auto samples = std::size_t(0.04 * rate);
        for (std::size_t n = 0; n < samples; ++n) moments.push_back(press(std::sin(w * double(n) / rate)));
        const auto r = dome.run(moments);
        const double x = f / f0, size = 1 / std::hypot(1 - x * x, 2 * z * x);
        const double phase = -std::atan2(2 * z * x, 1 - x * x) - w * delay;
        for (std::size_t n = samples - 2000; n < samples; ++n)
            EXPECT_NEAR(-r[n].drive[kFz], size * std::sin(w * double(n) / rate + phase), 4e-3 * size)
                << f;  // linear between samples
    }
}

TEST(DomeResonance, FollowsARampByDelayAndTwiceTheDampingOverW) {
    AtWork dome("capacitive", {"dome_resonance"}, "",
                "[effects.dome_resonance]\nresonance_Hz = 100\ndamping = 0.5\ndelay_s = 3.3e-3\n");
    std::vector<Moment> ramp;
    for (int n = 0; n <= 1000; ++n) ramp.push_back(press(1e-3 * n));
    const double lag_s = 3.3e-3 + 2 * 0.5 / (2 * std::numbers::pi * 100);
    EXPECT_NEAR(-dome.run(ramp).back().drive[kFz], 1 - lag_s, 1e-9);  // 1 N/s
}

}  // namespace
}  // namespace tactiled::sim
