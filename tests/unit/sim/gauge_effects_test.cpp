// Effects of place, electronics and environment on gauges, against closed forms and figures of the documents.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "drivers/sim/effects/influence.hpp"
#include "tests/unit/sim/effects_at_work.hpp"

namespace tactiled::sim {
namespace {

const std::string kMap =
    "sample = \"foil\"\ninfluence = \"" TACTILED_SOURCE_DIR "/config/calibration/table_influence.toml\"\n";
const std::string kSphere = "[body]\nshape = \"sphere\"\n";

Moment at(double x_m, double y_m, double radius_m, std::array<double, 3> force) {
    return {.load = {force[0], force[1], force[2], y_m * force[2], -x_m * force[2]},
            .x_m = x_m,
            .y_m = y_m,
            .radius_m = radius_m};
}

// Within 3e-5: the mean of the map over the plate differs by that from the finite elements for a load on all of it.
TEST(ContactPatch, OfAPointHasTheStrainsOfTheMap) {
    AtWork table("table", {"contact_patch"}, kMap, kSphere);
    for (const std::size_t row : {0u, 5u, 300u, 700u}) {
        const auto& point = table.sensor().table.influence[row];
        const Reading r = table(at(point[0], point[1], 1e-9, {0.3, -0.2, -1}));
        for (std::size_t k = 0; k < 8; ++k)
            EXPECT_NEAR(r.channel[k], 2 * (0.3 * point[2 + 3 * k] - 0.2 * point[3 + 3 * k] - point[4 + 3 * k]), 3e-5)
                << row << " " << k;
    }
}

TEST(ContactPatch, OnTheWholePlateChangesNothing) {
    AtWork table("table", {"contact_patch"}, kMap, kSphere);
    const Reading r = table(at(0, 0, 935e-6, {0.5, 0, -1}));
    for (std::size_t k = 0; k < 8; ++k)
        EXPECT_NEAR(r.channel[k], 0.5 * table.sensor().gain[k][kFx] - table.sensor().gain[k][kFz], 1e-15);
    AtWork flat("table", {"contact_patch"}, kMap);
    EXPECT_EQ(flat(at(0, 0, 1e-4, {0, 0, -1})).channel[0], -flat.sensor().gain[0][kFz]);
}

// Finite elements: 2332 microstrain under a patch of 0.3 mm in the middle, 422 under the whole plate.
TEST(ContactPatch, InTheMiddleIsThatOfTheFiniteElements) {
    AtWork table("table", {"contact_patch"}, kMap, kSphere);
    EXPECT_NEAR(table(at(0, 0, 0.15e-3, {0, 0, -1})).channel[0] / 2, 2332e-6, 0.06 * 2332e-6);
}

// The mean of the map over the plate is the strain of a load on the whole plate.
TEST(ContactPatch, MapAgreesWithTheUniformLoad) {
    AtWork table("table", {}, kMap, kSphere);
    const auto mean = InfluenceMap(table.sensor().table).mean(0, 0, table.sensor().table.plate_radius_m);
    for (const std::size_t gauge : {0u, 2u, 4u, 6u}) EXPECT_NEAR(mean[3 * gauge + 2], -422e-6, 0.06 * 422e-6);
    EXPECT_NEAR(mean[0], -725e-6, 0.03 * 725e-6);
}

TEST(ContactPatch, LargestExcessIsOne) {
    AtWork table("table", {}, kMap, kSphere);
    const InfluenceMap map(table.sensor().table);
    std::mt19937_64 random(1);
    const auto u = [&](double a, double b) { return std::uniform_real_distribution<>(a, b)(random); };
    for (int i = 0; i < 200; ++i) {
        const double x = u(0, 4e-4), y = u(0, 4e-4), radius = i % 2 == 0 ? u(0, 3e-4) : u(0, 1.2e-3);
        const auto max = map.largest_excess(x, y, radius), one = map.excess(u(-x, x), u(-y, y), u(0, radius));
        for (std::size_t k = 0; k < 8; ++k)
            for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_LE(std::abs(one[k][axis]), max[k][axis] * (1 + 1e-9));
    }
}

// sigma = F/A (1 + 4 x x0 / R^2)
TEST(LoadMoment, OfHairsIsThePressureOfAnEccentricLoad) {
    AtWork hair("hair", {"load_moment"}, "root_distance_m = 1e-3\narea_m2 = 2.8274334e-5");  // R = 3 mm
    Moment eccentric = press(0.05);
    eccentric.x_m = 0.5e-3;
    const Reading r = hair(eccentric), central = hair(press(0.05));
    const double part = 4 * 1e-3 * 0.5e-3 / 9e-6;
    EXPECT_NEAR(r.channel[0] / central.channel[0], 1 + part, 1e-7);
    EXPECT_NEAR(r.channel[2] / central.channel[2], 1 - part, 1e-7);
    EXPECT_EQ(r.channel[1], central.channel[1]);
}

TEST(BridgeNonlinearity, ReadsTwoPointEightPercentAs2Point76) {
    AtWork table("table", {"bridge_nonlinearity"});
    const double N = -0.028 / table.sensor().gain[0][kFz];
    EXPECT_NEAR(table(press(N)).channel[0], 0.027613412228796843, 1e-16);  // hardcases H25
}

TEST(GainSpread, IsOneFactorAChannel) {
    AtWork pad("capacitive", {"gain_spread"});
    const Reading none = pad(press(0)), one = pad(press(1)), two = pad(press(2));
    bool differ = false;
    for (std::size_t k = 0; k < 6; ++k) {
        const double gain = -pad.sensor().gain[k][kFz], e = (one.channel[k] - none.channel[k]) / gain - 1;
        EXPECT_NEAR(none.channel[k], pad.sensor().zero[k], 1e-15);
        EXPECT_NEAR(two.channel[k] - none.channel[k], 2 * (one.channel[k] - none.channel[k]), 1e-14);
        EXPECT_LE(std::abs(e), 3.4642 * (k < 5 ? 0.0185 : 0.053));
        differ |= std::abs(e) > 1e-3;
    }
    EXPECT_TRUE(differ);
}

TEST(GainSpread, HasItsStandardDeviationOverManySensors) {
    double sum = 0;
    for (int seed = 1; seed <= 500; ++seed) {
        AtWork table("table", {"gain_spread"}, "serial = " + std::to_string(seed),
                     "[effects.gain_spread]\ndeviation = 0.02\n");
        const double e = table(press(1)).channel[0] / -table.sensor().gain[0][kFz] - 1;
        sum += e * e;
    }
    EXPECT_NEAR(std::sqrt(sum / 500), 0.02, 0.002);
}

TEST(Crosstalk, IsLinearAndWithoutALoadNothing) {
    AtWork hair("hair", {"crosstalk"});
    const Moment x{.load = {0.01, 0, 0, 0, 0}}, z = press(0.02), both{.load = {0.01, 0, -0.02, 0, 0}};
    const Reading none = hair(press(0)), a = hair(x), b = hair(z), c = hair(both);
    bool leaks = false;
    for (std::size_t k = 0; k < 4; ++k) {
        EXPECT_EQ(none.channel[k], 0);
        EXPECT_NEAR(c.channel[k], a.channel[k] + b.channel[k], 1e-18);
        leaks |= std::abs(a.channel[1]) > 1e-4 * std::abs(a.channel[0]);  // H2 does not respond to x
    }
    EXPECT_TRUE(leaks);
}

TEST(TemperatureZero, OfPlatinumHairsIs8kPaAKelvin) {
    AtWork hair("hair", {"temperature_zero"}, "", "[effects.temperature_zero]\nmismatch = 0\n");
    const Reading r = hair({.ambient_K = 1});
    EXPECT_NEAR((r.channel[0] + r.channel[2]) / (2 * 3.74e-7), 8.0e3, 0.03e3);
}

TEST(TemperatureZero, OfNickelChromiumIs5mNAKelvin) {
    AtWork table("table", {"temperature_zero"}, "", "[effects.temperature_zero]\nmismatch = 0\nper_K = 1e-4\n");
    EXPECT_NEAR(table({.ambient_K = 2}).channel[0] / -table.sensor().gain[0][kFz], 2 * 5.2e-3, 0.1e-3);
}

TEST(TemperatureGain, IsAFactorOfTheSignal) {
    AtWork pad("capacitive", {"temperature_gain"}, "", "[effects.temperature_gain]\nper_K = 0.001\n");
    Moment warm = press(2);
    warm.ambient_K = 5;
    EXPECT_NEAR(pad(warm).channel[4] - pad.sensor().zero[4], 1.005 * 2 * 0.0405, 1e-14);
}

TEST(SelfHeating, GoesToItsRiseExponentially) {
    AtWork table("table", {"self_heating"}, "",
                 "[effects.self_heating]\nrise_K = 2\ntime_s = 3\nper_K = 1e-4\nmismatch = 0\n");
    const auto r = table.run(std::vector<Moment>(6001, press(0)));
    EXPECT_EQ(r[0].channel[0], 0);
    EXPECT_NEAR(r[3000].channel[0], 2e-4 * (1 - std::exp(-1)), 1e-14);
    EXPECT_NEAR(r[6000].channel[7], 2e-4 * (1 - std::exp(-2)), 1e-14);
}

TEST(ContactHeat, DiffusesThroughAMillimetreInPoint92s) {
    AtWork hair("hair", {"contact_heat"}, "height_m = 1e-3",
                "[effects.contact_heat]\nper_K = 1e-4\nmismatch = 0\nshare = 1\n");
    Moment touch = press(1e6);  // so large that the contact is full
    touch.body_K = 10;
    const auto r = hair.run(std::vector<Moment>(20'000, touch));
    const double zero = -1e6 * hair.sensor().gain[0][kFz], in_the_end = r.back().channel[0] - zero;
    EXPECT_NEAR(in_the_end, 1e-3, 1e-6);
    EXPECT_NEAR((r[919].channel[0] - zero) / in_the_end, 1 - std::exp(-1), 0.002);
    AtWork without("hair", {"contact_heat"});
    EXPECT_EQ(without({.body_K = 10}).channel[0], 0);
}

TEST(Dummy, FollowsTheRoomAndNoLoadAndNoBody) {
    AtWork hair("hair", {"temperature_zero", "contact_heat"}, "dummy = true",
                "[effects.temperature_zero]\nmismatch = 0.01\n[effects.contact_heat]\nmismatch = 0\n");
    ASSERT_EQ(hair.sensor().channels.back(), "H0");
    Moment touch = press(0.05);
    touch.body_K = touch.ambient_K = 2;
    const Reading room = hair(touch);
    EXPECT_NEAR(room.channel[4], 2 * 3e-3, 4 * 0.01 * 2 * 3e-3);
    EXPECT_NE(room.channel[4], 2 * 3e-3);  // a coefficient of its own
    touch.ambient_K = 0;
    touch.body_K = 10;
    const auto warmed = hair.run(std::vector<Moment>(5'000, touch));
    EXPECT_EQ(warmed.back().channel[4], 0);
    EXPECT_GT(warmed.back().channel[0] - warmed.front().channel[0], 1e-3);
}

TEST(TemperatureGradient, GivesEachHairAndTheDummyATemperatureOfItsOwn) {
    AtWork hair("hair", {"temperature_gradient"}, "dummy = true",
                "[effects.temperature_gradient]\ndifference_K = 0.1\nperiod_s = 2\nmismatch = 0\n");
    double most_K = 0;
    for (const Reading& r : hair.run(std::vector<Moment>(4'000, press(0)))) {
        for (std::size_t k = 0; k < 4; ++k) {
            const double difference_K = std::abs(r.channel[k] - r.channel[4]) / 3e-3;
            EXPECT_LE(difference_K, 0.1 * (1 + 1e-12));
            most_K = std::max(most_K, difference_K);
        }
    }
    EXPECT_GT(most_K, 0.03);
}

TEST(Humidity, SwellsPolyimideBy9ppmAPercent) {
    AtWork table("table", {"humidity"}, "sample = \"foil\"", "[effects.humidity]\nchange_percent = 10\ntime_s = 1\n");
    const auto r = table.run(std::vector<Moment>(20'000, press(0)));
    EXPECT_NEAR(r.back().channel[0], 2 * 9e-5, 1e-9);
    EXPECT_NEAR(r[1000].channel[0], 2 * 9e-5 * (1 - std::exp(-1)), 1e-9);
}

TEST(MountingCurvature, On8mmStrains1Point56Percent) {
    AtWork table("table", {"mounting_curvature"}, "sample = \"foil\"",
                 "[effects.mounting_curvature]\ncurvature_1_m = 125\n");
    const Reading r = table(press(0));
    EXPECT_NEAR(r.channel[0] / 2, 0.0156, 0.0001);  // R1 along the bend
    EXPECT_NEAR(r.channel[2], 0, 1e-15);            // R3 across
    AtWork none("table", {"mounting_curvature"});
    EXPECT_EQ(none(press(0)).channel[0], 0);
}

TEST(ZeroWalk, GoesWithTheRootOfTime) {
    double after_1 = 0, after_4 = 0, step = 0;
    constexpr int kSeeds = 400;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        AtWork table("table", {"zero_walk"}, "", "[effects.zero_walk]\nafter_1_s_N = 0.01\n", 64, seed);
        const auto r = table.run(std::vector<Moment>(64 * 4 + 1, press(0)));
        const double N = table.sensor().per_N[0];
        EXPECT_EQ(r[0].channel[0], 0);
        after_1 += std::pow(r[64].channel[0] / N, 2);
        after_4 += std::pow(r[256].channel[0] / N, 2);
        step += std::pow((r[192].channel[0] - r[128].channel[0]) / N, 2);
    }
    EXPECT_NEAR(std::sqrt(after_1 / kSeeds), 0.01, 0.0015);
    EXPECT_NEAR(std::sqrt(step / kSeeds), 0.01, 0.0015);
    EXPECT_NEAR(std::sqrt(after_4 / kSeeds), 0.02, 0.003);
}

}  // namespace
}  // namespace tactiled::sim
