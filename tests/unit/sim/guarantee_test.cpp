// Scenes in which a bound was once too small, and which the random scenes of property_test.cpp do not reach.
#include <gtest/gtest.h>

#include "tests/unit/sim/one_effect.hpp"

namespace tactiled::sim {
namespace {

// Compares auto with all effects for any wanted accuracy: within the guarantee, and no effect beyond its bound.
void expect_kept(const std::string& model, const std::string& rest, const std::string& head = "") {
    Scene scene = scene_with(model, rest, head);
    const Sensor& sensor = scene.sensors[0];
    for (const double wanted : {1e-4, 1e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0}) {
        scene.wanted_accuracy_N = wanted * sensor.full_scale_N;
        Simulation all(scene, "all"), chosen(scene, "auto"), measured(scene, "all");
        measured.measure_shares(true);
        double max_N = 0;
        for (const Block* a = &all.advance(0); a->n > 0; a = &all.advance(0)) {
            const Block& b = chosen.advance(0);
            measured.advance(0);
            for (std::size_t n = 0; n < a->n; ++n) {
                std::array<double, kMaxSensorChannels> change{};
                for (std::size_t k = 0; k < sensor.n(); ++k) change[k] = a->channel[k][n] - b.channel[k][n];
                for (std::size_t k = 0; k < sensor.n(); ++k) ASSERT_TRUE(std::isfinite(change[k]));
                if (!a->dropped[n] && !b.dropped[n]) max_N = std::max(max_N, sensor.largest_N(change));
            }
        }
        EXPECT_LE(max_N, chosen.choice(0).guaranteed_N * (1 + 1e-9) + 1e-12) << wanted << " of full scale wanted";
        const auto& decisions = measured.choice(0).decisions;
        for (std::size_t d = 0; d < decisions.size(); ++d)
            EXPECT_LE(measured.shares_N(0)[d], decisions[d].bound.change_N * (1 + 1e-9) + 1e-12)
                << decisions[d].effect->name;
    }
}

TEST(Guarantee, ADeafHairReadsNumbers) { expect_kept("hair", "normal_per_Pa = 0\nshear_per_Pa = 0\n" + press(0.02, 0.1)); }

TEST(Guarantee, HoldsAfterTheLastMotion) {
    expect_kept("hair", press(0.02, 0.02), "length_s = 2");
    expect_kept("capacitive", press(2, 0.02), "length_s = 2");
}

TEST(Guarantee, CountsThatJitterTakesTwoSamplesFurtherApart) {
    expect_kept("hair", "[[motion]]\ndo = \"warm\"\nambient_by_K = 20\nin_s = 2e-4\n", "rate_Hz = 55000");
    expect_kept("hair", press(0.02, 2e-4), "rate_Hz = 55000");
}

TEST(Guarantee, CountsThatTheOtherClockMayReadAnotherTemperature) {
    expect_kept("table", "[[motion]]\ndo = \"warm\"\nambient_by_K = 100\nin_s = 1\ncourse = \"at_once\"\n" + hold(1) +
                             "[effects.temperature_zero]\nper_K = 0\n[effects.temperature_gain]\nper_K = 0\n"
                             "[effects.lead_wires]\nshare = 1\n[effects.clock_drift]\ndrift_ppm = -1000\n"
                             "[[motion]]\ndo = \"warm\"\nambient_by_K = -100\nin_s = 1\n");
}

// A zero that is far off makes the temperature of a gain more important than the scene's load.
TEST(Guarantee, AsksForTheOthersBoundsAsTheyAreInTheChain) {
    expect_kept("table", "[[motion]]\ndo = \"warm\"\nambient_by_K = 10\nin_s = 1\ncourse = \"at_once\"\n" + hold(0.2) +
                             "[[motion]]\ndo = \"warm\"\nambient_by_K = -10\nin_s = 1\ncourse = \"at_once\"\n"
                             "[effects.gain_spread]\noffset_N = 10\n[effects.temperature_gain]\nper_K = 0.05\n"
                             "[effects.saturation]\nrail = 1000\n[effects.clock_drift]\ndrift_ppm = -1000\n");
}

TEST(Guarantee, CountsThatOneClockMayFindTheBodyAtRestAndTheOtherSliding) {
    const std::string slide = "[[motion]]\ndo = \"slide\"\nspeed_m_s = 0.5\nin_s = 0.1\n";
    const std::string stop = "[[motion]]\ndo = \"slide\"\nspeed_m_s = 0\nin_s = 0.1\n";
    const std::string effects =
        "[body]\nshape = \"textured\"\nfriction = 1\nkinetic_friction = 0.1\ntexture_pitch_m = 0.03\ntexture_height_m = "
        "1e-5\n[effects.stick_slip]\nstribeck_m_s = 1e-6\n";
    expect_kept("table", press(0.8, 0.1) + shear(0.7, 0, 0.1) + hold(0.1) + slide + effects);
    expect_kept("table", press(0.8, 0.1) + slide + stop + hold(0.1) + slide + stop + hold(0.1) + effects);
}

}  // namespace
}  // namespace tactiled::sim
