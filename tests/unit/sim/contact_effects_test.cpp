// Effects of time and contact against closed forms.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "one_effect.hpp"

namespace tactiled::sim {
namespace {

TEST(ClockDrift, TakesSamplesLaterAndLater) {
    const Scene scene = scene_with("table", "[effects.clock_drift]\ndrift_ppm = 100\n" + press(1, 10));
    const Recording is = run(scene, "clock_drift");
    EXPECT_NEAR(is.t_s[8000], 8.0008, 1e-12);
    EXPECT_NEAR(is.load[kFz][8000], -0.80008, 1e-12);
}

TEST(SamplingJitter, MakesNoiseOfARamp) {
    const Scene scene = scene_with("table", "[effects.sampling_jitter]\ndeviation_s = 1e-4\n" + press(1, 10));
    const Recording is = run(scene, "sampling_jitter");
    double sum = 0;
    for (std::size_t n = 1; n + 1 < is.t_s.size(); ++n) sum += std::pow(is.load[kFz][n] + double(n) * 1e-4, 2);
    EXPECT_NEAR(std::sqrt(sum / double(is.t_s.size())), 0.1 * 1e-4, 3e-7);  // rate * sigma
}

TEST(FrictionLimit, ShortensTheShearAndKeepsItsDirection) {
    const Scene scene = scene_with("table", press(0.5, 0.1) + shear(1, 30, 0.1) + hold(0.1), "body = {friction = 0.8}");
    const Recording is = run(scene, "friction_limit");
    EXPECT_NEAR(is.load[kFx].back(), 0.4 * std::cos(std::numbers::pi / 6), 1e-12);
    EXPECT_NEAR(is.load[kFy].back(), 0.4 * std::sin(std::numbers::pi / 6), 1e-12);
    EXPECT_NEAR(is.load[kFz].back(), -0.5, 1e-12);
}

// 1 / E* = (1 - 0.22^2) / 4.4 GPa + (1 - 0.3^2) / 3 GPa: E* = 1.9239 GPa; 0.3 N on a sphere of 1 mm: a = 48.90 um.
TEST(HertzContact, HasTheRadiusOfTheBook) {
    const Scene scene =
        scene_with("table", press(0.3, 0.1) + hold(0.1), "body = {shape = \"sphere\", radius_m = 1e-3, stiffness_Pa = 3e9}");
    const double modulus = 1 / ((1 - 0.22 * 0.22) / 4.4e9 + (1 - 0.09) / 3e9);
    EXPECT_NEAR(run(scene, "hertz_contact").radius_m.back(), std::cbrt(3 * 0.3 * 1e-3 / (4 * modulus)), 1e-12);
    EXPECT_NEAR(run(scene, "hertz_contact").radius_m.back(), 48.90e-6, 0.01e-6);
}

// Returns the shares of a 4 x 4 array's taxels in a press of a ball of 6 mm at (x, y).
std::vector<double> shares(double x_m, double y_m, double press_N, const std::string& shape = "sphere") {
    const Scene scene =
        scene_with("hair",
                   "array = [4, 4]\npitch_m = 8e-3\n" +
                       fmt::format("[[motion]]\ndo = \"move\"\nx_m = {}\ny_m = {}\nin_s = 0.01\n", x_m, y_m) +
                       press(press_N, 0.1) + hold(0.05),
                   fmt::format("body = {{shape = \"{}\", radius_m = 6e-3}}", shape));
    std::vector<double> all;
    for (std::size_t i = 0; i < 16; ++i) all.push_back(-run(scene, "none", i).load[kFz].back() / press_N);
    return all;
}

// 0.05 N on PDMS of 0.75 MPa: a^3 = 3 F R / (4 E*), a = 0.61 mm, not the ball's 6 mm.
TEST(Footprint, OfABallOnAnArrayIsHertzs) {
    const double modulus = 1 / ((1 - 0.49 * 0.49) / 750e3 + (1 - 0.09) / 3e9), a = std::cbrt(0.75 * 0.05 * 6e-3 / modulus);
    EXPECT_NEAR(a, 0.611e-3, 1e-6);
    const auto loaded = [](const std::vector<double>& all) {
        return std::count_if(all.begin(), all.end(), [](double share) { return share > 0; });
    };
    EXPECT_EQ(loaded(shares(-4e-3, 4e-3, 0.05)), 1);
    EXPECT_EQ(loaded(shares(0.99 * a, 4e-3, 0.05)), 2);
    EXPECT_EQ(loaded(shares(1.01 * a, 4e-3, 0.05)), 1);
    EXPECT_EQ(loaded(shares(0, 0, 0.05)), 4);
    EXPECT_GE(loaded(shares(0, 0, 0.05, "edge")), 4) << "an edge's contact is stated, not computed";
    for (const double x : {0.0, 0.1e-3, 0.4e-3, 3e-3}) {
        double sum = 0;
        for (const double share : shares(x, -x, 0.05)) sum += share;
        EXPECT_NEAR(sum, 1, 1e-12) << x;
    }
    // The part of sqrt(1 - r^2) beyond a line at a / 2 from the middle is 5/32.
    const auto beside = shares(a / 2, 4e-3, 0.05);
    EXPECT_NEAR(*std::min_element(beside.begin() + 8, beside.end(),
                                  [](double p, double q) { return (p > 0 ? p : 1) < (q > 0 ? q : 1); }),
                5.0 / 32, 1e-9);
    // Eight times the force, twice the radius.
    EXPECT_EQ(loaded(shares(1.9 * a, 4e-3, 0.4)), 2);
}

TEST(Adhesion, PullsWithThreeHalvesPiWR) {
    const Scene scene = scene_with("table", press(0.3, 0.1) + press(0, 0.1) + hold(0.1),
                                   "rate_Hz = 10000\nbody = {shape = \"sphere\", radius_m = 5e-3, adhesion_J_m2 = 0.05}");
    const Recording is = run(scene, "adhesion");
    EXPECT_NEAR(*std::max_element(is.load[kFz].begin(), is.load[kFz].end()), 1.178e-3, 0.02e-3);  // 1.2 mN
    EXPECT_EQ(is.load[kFz].back(), 0);
}

// Cao et al.'s cap of 1 mm: 10 Pa.
TEST(CapWeight, OfAHairSensorIsTenPascal) {
    const Scene scene = scene_with("hair", press(0.01, 0.1));
    const Sensor& sensor = scene.sensors[0];
    EXPECT_NEAR(-run(scene, "cap_weight").channel[0][0] / sensor.gain[0][kFz] / sensor.hair.area_m2, 10.1, 0.01);
}

TEST(Misalignment, ByAQuarterTurnSeesXAsMinusY) {
    const Scene scene = scene_with("table", "[effects.misalignment]\nabout_x_deg = 0\nabout_y_deg = 0\nabout_z_deg = 90\n" +
                                                press(1, 0.1) + shear(0.5, 0, 0.1) + hold(0.1));
    const Recording is = run(scene, "misalignment");
    EXPECT_NEAR(is.load[kFx].back(), 0, 1e-12);
    EXPECT_NEAR(is.load[kFy].back(), -0.5, 1e-12);
    EXPECT_NEAR(is.load[kFz].back(), -1, 1e-12);
}

TEST(Misalignment, KeepsTheForce) {
    const Scene scene =
        scene_with("table", "[effects.misalignment]\nabout_x_deg = 20\nabout_y_deg = -35\nabout_z_deg = 50\n" +
                                press(1, 0.1) + shear(0.5, 70, 0.1) + hold(0.1));
    const Recording is = run(scene, "misalignment");
    EXPECT_NEAR(std::hypot(is.load[kFx].back(), is.load[kFy].back(), is.load[kFz].back()), std::hypot(1, 0.5), 1e-12);
}

// At the onset of sliding the body has moved by 3 mu N / (16 a) ((2-nu1)/G1 + (2-nu2)/G2).
TEST(PartialSlip, MovesThePressByMindlinsDisplacement) {
    const Scene scene = scene_with("table", press(1, 0.1) + shear(0.5, 0, 0.1) + hold(0.01),
                                   "body = {shape = \"sphere\", radius_m = 5e-3, friction = 0.5, stiffness_Pa = 3e9}");
    const double modulus = 1 / ((1 - 0.22 * 0.22) / 4.4e9 + (1 - 0.09) / 3e9), a = std::cbrt(3 * 5e-3 / (4 * modulus));
    const double G1 = 4.4e9 / (2 * 1.22), G2 = 3e9 / 2.6;
    const double moved_m = 3 * 0.5 / (16 * a) * (1.78 / G1 + 1.7 / G2);
    EXPECT_NEAR(run(scene, "partial_slip").load[kMy].back(), moved_m, 1e-4 * moved_m);
    EXPECT_NEAR(run(scene, "partial_slip").load[kMx].back(), 0, 1e-15);
}

const std::string kSlide = "[[motion]]\ndo = \"slide\"\nspeed_m_s = 0.02\nin_s = 0.001\n";

// f = v / pitch: 20 Hz; half the ridge's height on half the skin's stiffness, averaged over its contact.
TEST(Texture, PassesAtSpeedOverPitch) {
    const Scene scene =
        scene_with("hair", press(0.05, 0.1) + kSlide + hold(1),
                   "body = {shape = \"textured\", texture_pitch_m = 1e-3, texture_height_m = 1e-6, friction = 0.8}");
    const Recording is = run(scene, "texture");
    int rises = 0;
    double max = 0;
    for (std::size_t n = 102; n < is.t_s.size(); ++n) {
        rises += is.load[kFz][n - 1] < -0.05 && is.load[kFz][n] >= -0.05;
        max = std::max(max, std::abs(is.load[kFz][n] + 0.05));
    }
    EXPECT_NEAR(rises, 20, 1);
    const double skin_N_m = 750e3 * 2.827e-5 / 1e-3, x = 2 * std::numbers::pi * 0.2;
    EXPECT_NEAR(max, 0.5 * skin_N_m * 0.5e-6 * std::sin(x) / x, 1e-6);
}

// A slider on a spring: period 2 (mu_s - mu_k) N / (k v), about the kinetic friction.
TEST(StickSlip, HasThePeriodOfASliderOnASpring) {
    const std::string body = "body = {friction = 0.5, kinetic_friction = 0.4}\nrate_Hz = 20000";
    const Scene scene = scene_with(
        "capacitive",
        "[effects.stick_slip]\nstribeck_m_s = 100\nstiffness = 1\n" + press(5, 0.1) + shear(2, 0, 0.1) + kSlide + hold(1),
        body);
    const Recording is = run(scene, "stick_slip");
    double sum = 0, min = 1e9, max = 0;
    int slips = 0;
    for (std::size_t n = 4100; n < is.t_s.size(); ++n) {
        slips += is.load[kFx][n] < is.load[kFx][n - 1] - 0.1;
        sum += is.load[kFx][n];
        min = std::min(min, is.load[kFx][n]);
        max = std::max(max, is.load[kFx][n]);
    }
    const double period_s = 2 * 0.1 * 5 * 0.79e-3 / 0.02;
    EXPECT_NEAR(slips, 1 / period_s, 1);
    EXPECT_NEAR(sum / double(is.t_s.size() - 4100), 2, 0.02);
    EXPECT_NEAR(min, (2 * 0.4 - 0.5) * 5, 0.01);
    EXPECT_NEAR(max, 0.5 * 5, 0.01);
}

TEST(ArraySpread, GivesToNeighboursWhatItTakes) {
    const Scene scene = scene_with("hair", "array = [1, 3]\npitch_m = 2e-3\n" + press(0.05, 0.1) + hold(0.1),
                                   "body = {shape = \"sphere\", radius_m = 1e-4}");
    EXPECT_NEAR(run(scene, "array_spread", 0).load[kFz].back(), -0.05 * 0.05, 1e-12);
    EXPECT_NEAR(run(scene, "array_spread", 1).load[kFz].back(), -0.05 * 0.90, 1e-12);
    EXPECT_NEAR(run(scene, "array_spread", 2).load[kFz].back(), -0.05 * 0.05, 1e-12);
}

}  // namespace
}  // namespace tactiled::sim
