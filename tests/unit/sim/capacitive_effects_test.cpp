// The effect of press, shift and tilt on the capacitive sensor, against closed forms and independently derived
// figures.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "drivers/sim/effects/pad.hpp"
#include "tests/unit/sim/effects_at_work.hpp"

namespace tactiled::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Moment sheared(double fx, double fy, double N = 0) { return {.load = {fx, fy, -N, 0, 0}}; }

// 1/2 clip(rho)^2 - inner^2 over the sector's angles by the midpoint rule.
double area_by_sum(const Pad::Electrode& e, double R, double dx, double dy) {
    constexpr int kSteps = 400'000;
    const double delta = std::hypot(dx, dy), towards = std::atan2(dy, dx);
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
        const double t = e.centre_rad + e.opening_rad * ((i + 0.5) / kSteps - 0.5) - towards, u = delta * std::sin(t);
        const double rho = std::clamp(delta * std::cos(t) + std::sqrt(R * R - u * u), e.inner_m, e.outer_m);
        sum += (rho * rho - e.inner_m * e.inner_m) / 2;
    }
    return sum * e.opening_rad / kSteps;
}

TEST(ExactOverlap, HasTheAreasOfThirtyDigitQuadrature) {
    // R = 5 mm, inner 3 mm, 80 degrees; mm^2 at a shift of 1 and of 0.5 mm along +x.
    AtWork pad("capacitive", {"exact_overlap"}, "shift_per_N_m = 1e-3");
    const double rest_mm2 = 40 * kDegree * 16, sector_pF = pad.sensor().capacitive.sector_pF;
    const auto area_mm2 = [&](const Reading& r, std::size_t k) {
        return rest_mm2 * (1 + (r.channel[k] - pad.sensor().zero[k]) / sector_pF);
    };
    const Reading one = pad(sheared(1, 0)), half = pad(sheared(0.5, 0)), up = pad(sheared(0, 1));
    EXPECT_NEAR(area_mm2(one, 0), 18.0726374079756, 1e-9);
    EXPECT_NEAR(area_mm2(one, 2), 10.6777033362576, 1e-9);
    EXPECT_NEAR(area_mm2(one, 1), 5.25238477056405, 1e-9);
    EXPECT_NEAR(area_mm2(one, 3), 10.6777033362576, 1e-9);
    EXPECT_NEAR(area_mm2(half, 0), 14.5049316536622, 1e-9);
    EXPECT_NEAR(area_mm2(half, 2), 11.0470062436372, 1e-9);
    EXPECT_NEAR(area_mm2(half, 1), 8.08148471011823, 1e-9);
    EXPECT_NEAR(area_mm2(up, 2), 18.0726374079756, 1e-9);
    EXPECT_NEAR(one.channel[4], pad.sensor().zero[4], 1e-15);  // the centre stays covered
}

TEST(ExactOverlap, ClipsAtTheElectrodesEdges) {
    std::mt19937_64 random(1);
    const auto u = [&](double a, double b) { return std::uniform_real_distribution<>(a, b)(random); };
    for (int i = 0; i < 60; ++i) {
        const bool disc = i % 5 == 0;
        const Pad::Electrode e{disc ? 0 : u(1, 4.5), u(4.6, 6), u(-4, 4), disc ? 2 * std::numbers::pi : u(0.1, 3)};
        const double delta = u(0.01, 4.4), towards = u(-4, 4), R = 5;
        const double dx = delta * std::cos(towards), dy = delta * std::sin(towards);
        EXPECT_NEAR(Pad::area_change(e, R, dx, dy), area_by_sum(e, R, dx, dy) - area_by_sum(e, R, 0, 0), 1e-4) << i;
    }
}

TEST(ExactOverlap, IsExactForAPicometre) {
    // hardcases: R = 5 mm, 1 pm, t from -0.7 to 0.7.
    const Pad::Electrode e{3e-3, 7e-3, 0, 1.4};
    EXPECT_NEAR(Pad::area_change(e, 5e-3, 1e-12, 0) / 6.442176872869635e-15, 1, 1e-9);
}

TEST(Pad, LargestOverlapIsOne) {
    std::mt19937_64 random(2);
    const auto u = [&](double a, double b) { return std::uniform_real_distribution<>(a, b)(random); };
    AtWork any("capacitive", {});
    for (int i = 0; i < 2000; ++i) {
        Pad pad(any.sensor());
        pad.electrode[0] = {u(1e-3, 4.9e-3), u(5e-3, 8e-3), u(-3, 3), u(0.05, 1.57)};
        const double shift = u(0, 5e-3), less = shift * u(0, 1), towards = u(-4, 4);
        EXPECT_LE(std::abs(pad.overlap_change(0, less * std::cos(towards), less * std::sin(towards))),
                  pad.largest_overlap(0, shift) * (1 + 1e-12));
    }
}

TEST(GapGain, AloneGoesWithTheInverseGap) {
    AtWork pad("capacitive", {"gap_gain"}, "strain_per_N = 0.03\ncentre_pF = 2");
    const CapacitiveSample& c = pad.sensor().capacitive;
    const Reading r = pad(sheared(0.2, 0, 10)), pressed = pad(press(10));
    EXPECT_NEAR(pressed.channel[4], c.stray_centre_pF + c.centre_pF / 0.7, 1e-12);
    // 30 % of compression: the same shear reads 43 % more.
    EXPECT_NEAR((r.channel[0] - pressed.channel[0]) / (0.2 * pad.sensor().gain[0][kFx]), 1 / 0.7, 1e-9);
    EXPECT_EQ(r.channel[5], pad.sensor().zero[5] + 10 * c.piezo_V_per_N);
}

TEST(GapGain, WithExactOverlapIsThePlateFormula) {
    AtWork pad("capacitive", {"exact_overlap", "gap_gain"}, "strain_per_N = 0.03\ncentre_pF = 2\nshift_per_N_m = 1e-3");
    const CapacitiveSample& c = pad.sensor().capacitive;
    const double rest_mm2 = 40 * kDegree * 16;
    const Reading r = pad(sheared(1, 0, 8));
    EXPECT_NEAR(r.channel[0], c.stray_sector_pF + c.sector_pF * 18.0726374079756 / rest_mm2 / (1 - 0.24), 1e-9);
    EXPECT_NEAR(r.channel[1], c.stray_sector_pF + c.sector_pF * 5.25238477056405 / rest_mm2 / (1 - 0.24), 1e-9);
    EXPECT_NEAR(r.channel[3], c.stray_sector_pF + c.sector_pF * 10.6777033362576 / rest_mm2 / (1 - 0.24), 1e-9);
    EXPECT_NEAR(r.channel[4], c.stray_centre_pF + c.centre_pF / (1 - 0.24), 1e-9);
}

TEST(FringeField, IsKirchhoffs) {
    const auto f = [](double r, double d) {
        return 1 + d / (std::numbers::pi * r) * (std::log(16 * std::numbers::pi * r / d) - 1);
    };
    EXPECT_NEAR(f(6, 3), 1.57, 0.005);
    EXPECT_NEAR(f(3, 3), 1.93, 0.005);
    AtWork pad("capacitive", {"gap_gain", "fringe_field"},
               "strain_per_N = 0.05\ncentre_radius_m = 3e-3\ninner_radius_m = 3.1e-3\ndisc_radius_m = 6e-3\ngap_m = 3e-3\n");
    const CapacitiveSample& c = pad.sensor().capacitive;
    EXPECT_NEAR(pad(press(0)).channel[4], pad.sensor().zero[4], 1e-15);
    EXPECT_NEAR(pad(press(8)).channel[4], c.stray_centre_pF + c.centre_pF * f(3, 1.8) / f(3, 3) * 3 / 1.8, 1e-12);
}

TEST(Tilt, IsTheMeanOfOneOverTheGap) {
    AtWork pad("capacitive", {"gap_gain", "tilt"}, "strain_per_N = 0.05", "[effects.tilt]\nmounted_rad = 0.2\n");
    const CapacitiveSample& c = pad.sensor().capacitive;
    const auto mean = [](double k) {  // of 1 / (1 + k x) over the unit disc
        double sum = 0, area = 0;
        for (int i = 0; i < 100'000; ++i) {
            const double x = (i + 0.5) / 50'000 - 1, width = std::sqrt(1 - x * x);
            sum += width / (1 + k * x);
            area += width;
        }
        return sum / area;
    };
    const double k = c.centre_radius_m * 0.2 / c.gap_m;
    EXPECT_NEAR(pad(press(0)).channel[4], pad.sensor().zero[4], 1e-15);
    EXPECT_NEAR(pad(press(10)).channel[4], c.stray_centre_pF + c.centre_pF * 2 * mean(2 * k) / mean(k), 1e-6);
}

TEST(LoadMoment, OfAPadPressesTheNearElectrodeMore) {
    AtWork pad("capacitive", {"load_moment"});
    const CapacitiveSample& c = pad.sensor().capacitive;
    Moment eccentric = press(2);
    eccentric.x_m = 1e-3;
    const Reading r = pad(eccentric), central = pad(press(2));
    // Foundation of the press's stiffness K / A, softer for a tilt by (1 + 2 S^2 / 3) / (1 + 2 S^2).
    const double R = c.disc_radius_m, S2 = R * R / (4 * c.gap_m * c.gap_m), K = 1 / (c.strain_per_N * c.gap_m);
    const double tilt = 2 * 1e-3 / (K * R * R / 4 * (1 + 2 * S2 / 3) / (1 + 2 * S2));
    const double centroid = 2.0 / 3 * (125 - 27) / (25 - 9.0) * 1e-3 * std::sin(40 * kDegree) / (40 * kDegree);
    EXPECT_NEAR(r.channel[0] - central.channel[0], c.sector_pF * tilt * centroid / c.gap_m, 1e-12);
    EXPECT_NEAR(r.channel[1] - central.channel[1], -c.sector_pF * tilt * centroid / c.gap_m, 1e-12);
    EXPECT_EQ(r.channel[2], central.channel[2]);
    EXPECT_EQ(r.channel[4], central.channel[4]);
}

TEST(PiezoLeak, DroopsAfterAStepAndSettlesOnARamp) {
    AtWork film("capacitive", {"piezo_leak"}, "", "[effects.piezo_leak]\ntime_s = 0.2\n");
    const double V = film.sensor().capacitive.piezo_V_per_N, zero = film.sensor().zero[5];
    std::vector<Moment> ramp;
    for (int n = 1; n <= 300; ++n) ramp.push_back(press(1e-3 * n * 4));  // 4 N/s
    const auto r = film.run(ramp);
    for (const int n : {1, 10, 100, 300})
        EXPECT_NEAR(r[std::size_t(n - 1)].channel[5] - zero, V * 4 * 0.2 * (1 - std::exp(-1e-3 * n / 0.2)), 1e-14);

    AtWork step("capacitive", {"piezo_leak"}, "", "[effects.piezo_leak]\ntime_s = 0.2\n");
    const auto s = step.run(std::vector<Moment>(400, press(1)));
    EXPECT_NEAR((s[300].channel[5] - zero) / (s[0].channel[5] - zero), std::exp(-0.3 / 0.2), 1e-12);
    EXPECT_NEAR(s[0].channel[5] - zero, V * -std::expm1(-1e-3 / 0.2) / (1e-3 / 0.2), 1e-14);
    EXPECT_NEAR(s[300].channel[4], film.sensor().zero[4] + 0.0405, 1e-12);  // the capacitance holds
}

TEST(Pyroelectric, TenthOfAKelvinOnASquareCentimetreReads10Point8N) {
    AtWork film("capacitive", {"pyroelectric"}, "disc_radius_m = 5.6419e-3",  // 1 cm^2
                "[effects.pyroelectric]\nleak_s = 1e6\n", 100);
    const auto r = film.run(std::vector<Moment>(10'000, {.ambient_K = 0.1}));  // 100 s, 12 times the diffusion
    EXPECT_NEAR((r.back().channel[5] - film.sensor().zero[5]) / film.sensor().capacitive.piezo_V_per_N, 10.8, 0.01);
    EXPECT_EQ(r.back().channel[4], film.sensor().zero[4]);
}

TEST(Pyroelectric, ChargeRunsOff) {
    AtWork film("capacitive", {"pyroelectric"}, "", "", 100);
    const auto r = film.run(std::vector<Moment>(10'000, {.ambient_K = 1}));
    EXPECT_NEAR(r.back().channel[5], film.sensor().zero[5], 1e-3);
}

TEST(Triboelectric, IsHeardOnlyWhileTheLoadMoves) {
    AtWork film("capacitive", {"triboelectric"});
    const double zero = film.sensor().zero[5], V = film.sensor().capacitive.piezo_V_per_N;
    const auto still = film.run(std::vector<Moment>(3000, press(0)));
    for (const Reading& r : still) EXPECT_EQ(r.channel[5], zero);
    double sum = 0;
    std::vector<Moment> moving;
    for (int n = 0; n < 20'000; ++n) moving.push_back(press(5 + 5 * std::sin(n * 0.1)));
    const auto loud = film.run(moving);
    for (std::size_t n = 0; n < loud.size(); ++n) {
        const double noise_N = (loud[n].channel[5] - zero) / V - 5 - 5 * std::sin(double(n) * 0.1);
        EXPECT_LE(std::abs(noise_N), 0.02 * 3.4642 + 1e-12);
        sum += noise_N * noise_N;
    }
    EXPECT_NEAR(std::sqrt(sum / 20'000), 0.02 * std::sqrt(2.0 / 3), 0.003);  // linear between its values
    const auto after = film.run(std::vector<Moment>(5000, press(5)));
    EXPECT_NEAR(after.back().channel[5], zero + 5 * V, 1e-12);
}

TEST(StrayCapacitance, IsSlowAndOfItsStandardDeviation) {
    AtWork pad("capacitive", {"stray_capacitance"}, "",
               "[effects.stray_capacitance]\ndeviation_pF = 0.01\nfrequency_Hz = 5\n");
    const auto r = pad.run(std::vector<Moment>(200'000, press(0)));
    double sum = 0, steepest = 0, common = 0;
    for (std::size_t n = 0; n < r.size(); ++n) {
        const double a = r[n].channel[0] - pad.sensor().zero[0], b = r[n].channel[1] - pad.sensor().zero[1];
        sum += a * a;
        common += a * b;
        if (n > 0) steepest = std::max(steepest, std::abs(r[n].channel[0] - r[n - 1].channel[0]));
    }
    EXPECT_NEAR(std::sqrt(sum / double(r.size())), 0.01 * std::sqrt(2.0 / 3), 0.0006);
    EXPECT_LE(steepest, 0.01 * 2 * 3.4642 / 100);  // a new value each 0.1 s
    EXPECT_NEAR(common / sum, 0, 0.1);
}

}  // namespace
}  // namespace tactiled::sim
