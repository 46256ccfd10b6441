#include "drivers/sim/scene.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "drivers/sim/simulation.hpp"
#include "tests/unit/sim/scene_of.hpp"

namespace tactiled::sim {
namespace {

const std::string kHead =
    "format = 1\ntitle = \"t\"\n[body]\nmass_kg = 0.05\nfriction = 0.8\nkinetic_friction = 0.5\n[[sensor]]\nname = "
    "\"left\"\nmodel = \"table\"\n";

std::string refused(const std::string& text) {
    try {
        scene_of(text);
    } catch (const SetupError& e) { return e.what(); }
    return "";
}

// The load and motion at each sample of the first sensor.
struct World {
    std::vector<double> t_s, fx, fy, fz, speed, slide, acceleration;
};

World world_of(const std::string& motions, const std::string& head = kHead) {
    const Scene scene = scene_of(head + motions);
    Simulation simulation(scene, "none");
    World w;
    for (const Block* b = &simulation.advance(0); b->n > 0; b = &simulation.advance(0))
        for (std::size_t n = 0; n < b->n; ++n) {
            w.t_s.push_back(b->t_s[n]);
            w.fx.push_back(b->load[kFx][n]);
            w.fy.push_back(b->load[kFy][n]);
            w.fz.push_back(b->load[kFz][n]);
            w.speed.push_back(b->speed_m_s[n]);
            w.slide.push_back(b->slide_m[n]);
            w.acceleration.push_back(b->acceleration_m_s2[n]);
        }
    return w;
}

TEST(Scene, APressGoesStraightToItsForceAndStays) {
    const World w = world_of("[[motion]]\ndo = \"press\"\nto_N = 0.5\nin_s = 0.1\n[[motion]]\ndo = \"hold\"\nfor_s = 0.1\n");
    ASSERT_EQ(w.fz.size(), 200u);
    EXPECT_EQ(w.fz[0], 0);
    EXPECT_NEAR(w.fz[50], -0.25, 1e-12);
    EXPECT_NEAR(w.fz[100], -0.5, 1e-12);
    EXPECT_NEAR(w.fz[199], -0.5, 1e-12);
}

TEST(Scene, AShearActsInItsDirectionAndTurns) {
    const World w = world_of(
        "[[motion]]\ndo = \"shear\"\nto_N = 1\ndirection_deg = 30\nin_s = 0.1\n"
        "[[motion]]\ndo = \"rotate\"\nby_deg = 60\nin_s = 0.1\n[[motion]]\ndo = \"hold\"\nfor_s = 0.01\n");
    EXPECT_NEAR(w.fx[50], 0.5 * std::cos(M_PI / 6), 1e-12);
    EXPECT_NEAR(w.fy[50], 0.5 * std::sin(M_PI / 6), 1e-12);
    EXPECT_NEAR(w.fx[150], std::cos(M_PI / 3), 1e-9);
    EXPECT_NEAR(w.fx[205], 0, 1e-12);
    EXPECT_NEAR(w.fy[205], 1, 1e-12);
}

TEST(Scene, ALiftTakesTheWeightThenTheAcceleration) {
    const World w = world_of(
        "[[motion]]\ndo = \"lift\"\nacceleration_m_s2 = 2\ndirection_deg = 180\nin_s = 0.2\nfor_s = 0.8\n"
        "[[motion]]\ndo = \"hold\"\nfor_s = 0.01\n");
    EXPECT_NEAR(w.fx[200], -0.05 * 9.80665, 1e-9);
    EXPECT_NEAR(w.fx[400], -0.05 * (9.80665 + 2), 1e-9);
    EXPECT_NEAR(w.acceleration[400], 2, 1e-9);
    EXPECT_NEAR(w.fx[800], -0.05 * (9.80665 - 2), 1e-9);
    EXPECT_NEAR(w.fx[1005], -0.05 * 9.80665, 1e-9);
}

TEST(Scene, ALiftMayTravelLeanAndHaveAMassOfItsOwn) {
    const World w = world_of(
        "[[motion]]\ndo = \"press\"\nto_N = 1\nin_s = 0.1\n"
        "[[motion]]\ndo = \"lift\"\nmass_kg = 0.1\nlean_deg = 30\nacceleration_m_s2 = 2\ndirection_deg = 0\nin_s = 0.1\n"
        "for_s = 0.4\ntravel_s = 0.5\n[[motion]]\ndo = \"hold\"\nfor_s = 0.01\n");
    const double weight_N = 0.1 * 9.80665, heavier_N = 0.1 * (9.80665 + 2);
    EXPECT_NEAR(w.fx[200], weight_N * std::cos(M_PI / 6), 1e-9);
    EXPECT_NEAR(w.fz[200], -1 - weight_N * 0.5, 1e-9);
    EXPECT_NEAR(w.fx[300], heavier_N * std::cos(M_PI / 6), 1e-9);
    EXPECT_NEAR(w.fz[300], -1 - heavier_N * 0.5, 1e-9);
    EXPECT_NEAR(w.fx[650], weight_N * std::cos(M_PI / 6), 1e-9);  // during the motion
    EXPECT_NEAR(w.acceleration[1000], -2, 1e-9);
}

TEST(Scene, ASlideAddsUpItsPath) {
    const World w =
        world_of("[[motion]]\ndo = \"slide\"\nspeed_m_s = 0.1\nin_s = 0.1\n[[motion]]\ndo = \"hold\"\nfor_s = 0.1\n");
    EXPECT_NEAR(w.slide[100], 0.1 * 0.1 / 2, 1e-12);
    EXPECT_NEAR(w.slide[199], 0.005 + 0.1 * 0.099, 1e-12);
}

TEST(Scene, ASlipPullsWithTheKineticFriction) {
    const World w = world_of(
        "[[motion]]\ndo = \"press\"\nto_N = 0.4\nin_s = 0.1\n[[motion]]\ndo = \"slip\"\nspeed_m_s = 0.02\nfor_s = 0.1\n");
    EXPECT_NEAR(w.fx[150], 0.2, 1e-9);
    EXPECT_NEAR(w.speed[150], 0.02, 1e-12);
    EXPECT_LT(w.speed.back(), 0.003);
}

TEST(Scene, AShakeNeverPulls) {
    const World w = world_of(
        "[[motion]]\ndo = \"press\"\nto_N = 0.1\nin_s = 0.1\n[[motion]]\ndo = \"shake\"\namplitude_N = 0.3\nfrom_Hz = "
        "5\nfor_s = 0.2\n");
    EXPECT_NEAR(*std::min_element(w.fz.begin(), w.fz.end()), -0.4, 1e-9);
    EXPECT_EQ(*std::max_element(w.fz.begin(), w.fz.end()), 0);
}

TEST(Scene, ARepetitionIsTheSameAgain) {
    const std::string cycle =
        "[[motion]]\ndo = \"press\"\nto_N = 0.5\nin_s = 0.05\n[[motion]]\ndo = \"press\"\nto_N = 0\nin_s = 0.05\n";
    const World w = world_of(cycle + "[[motion]]\ndo = \"repeat\"\nlast = 2\ntimes = 50\n");
    ASSERT_EQ(w.fz.size(), 5000u);
    for (std::size_t i = 0; i < w.fz.size(); ++i) ASSERT_NEAR(w.fz[i], w.fz[i % 100], 1e-9) << i;
    EXPECT_NE(refused(kHead + "[[motion]]\ndo = \"press\"\nto_N = 1\n[[motion]]\ndo = \"repeat\"\ntimes = 2\n")
                  .find("scene.toml:"),
              std::string::npos);
}

TEST(Scene, StepsAreEvenAndEachIsHeld) {
    const World up = world_of("[[motion]]\ndo = \"steps\"\nto_N = 1\ncount = 4\nin_s = 0.01\nhold_s = 0.09\n");
    ASSERT_EQ(up.fz.size(), 400u);
    for (std::size_t step = 1; step <= 4; ++step)
        for (const std::size_t held : {10u, 99u}) EXPECT_NEAR(up.fz[100 * (step - 1) + held], -0.25 * double(step), 1e-12);
    const World around = world_of(
        "[[motion]]\ndo = \"shear\"\nto_N = 1\ndirection_deg = 0\nin_s = 0.1\n[[motion]]\ndo = \"steps\"\non = "
        "\"direction\"\nby_deg = 360\ncount = 16\nin_s = 0.01\nhold_s = 0.09\n");
    EXPECT_NEAR(around.fx[150], std::cos(M_PI / 8), 1e-12);
    EXPECT_NEAR(around.fy[450], std::sin(M_PI / 2), 1e-12);
    EXPECT_NEAR(around.fx[1650], 1, 1e-12);
}

TEST(Scene, AWanderStaysWithinItsLoadsAndHangsOnItsSeed) {
    const auto wander = [](int seed) {
        return world_of(
            fmt::format("[[motion]]\ndo = \"wander\"\ncount = 50\nseed = {}\npress_from_N = 0.2\npress_to_N = "
                        "1\nshear_to_N = 0.5\nin_s = 0.01\nhold_s = 0.01\n",
                        seed));
    };
    const World w = wander(1);
    double min = 1, max = 0, shear = 0;
    for (std::size_t i = 10; i < w.fz.size(); ++i) {
        min = std::min(min, -w.fz[i]);
        max = std::max(max, -w.fz[i]);
        shear = std::max(shear, std::hypot(w.fx[i], w.fy[i]));
    }
    EXPECT_GE(min, 0.2);
    EXPECT_LE(max, 1);
    EXPECT_GT(max - min, 0.7);
    EXPECT_LE(shear, 0.5);
    EXPECT_GT(shear, 0.45);
    EXPECT_EQ(w.fz, wander(1).fz);
    EXPECT_NE(w.fz, wander(2).fz);
}

TEST(Scene, AWanderWithRestsHasLoadsOfAllSizesAndReleasesThem) {
    const std::string wander =
        "[[motion]]\ndo = \"wander\"\ncount = 40\npress_from_N = 0.5\npress_to_N = 1\nshear_to_N = 0.5\nin_s = 0.01\n"
        "hold_s = 0.04\n";
    EXPECT_GE(-world_of(wander).fz[20], 0.5);
    for (const char* const more : {"", "mirrored = true\n"}) {
        const World w = world_of(wander + "rest_s = 0.08\n" + more);
        std::vector<double> held;  // one of each load
        std::size_t rests = 0, group = 0, longest = 0;
        for (std::size_t i = 30; i < w.fz.size(); i += 50) {
            if (w.fz[i] == 0) {
                EXPECT_EQ(std::hypot(w.fx[i], w.fy[i]), 0);
                for (std::size_t k = i - 15; k < i + 50; ++k) EXPECT_EQ(w.fz.at(k), 0) << i;
                i += 40;  // 10 ms of release and 80 ms of rest
                ++rests;
                group = 0;
            } else {
                held.push_back(-w.fz[i]);
                longest = std::max(longest, ++group);
            }
        }
        EXPECT_EQ(group, 0u);  // the last one is released, too
        EXPECT_EQ(held.size(), *more != 0 ? 80u : 40u);
        EXPECT_GE(rests, held.size() / 8);
        EXPECT_LE(longest, 8u);
        EXPECT_GT(longest, 3u);
        EXPECT_LT(*std::min_element(held.begin(), held.end()), 0.3);  // of 0.5
        EXPECT_GT(*std::max_element(held.begin(), held.end()), 0.7);
    }
}

TEST(Scene, AMirroredWanderComesAgainTurnedByHalfATurn) {
    const auto wander = [](const std::string& more) {
        return world_of(
            "[[motion]]\ndo = \"wander\"\ncount = 20\npress_to_N = 1\nshear_to_N = 0.5\nwithin_m = 0.001\nin_s = 0.01\n"
            "hold_s = 0.04\n" +
            more);
    };
    const World once = wander(""), twice = wander("mirrored = true\n");
    const std::size_t half = 20 * 50;
    ASSERT_GE(twice.fz.size(), 2 * half);
    for (std::size_t i = 0; i < half; ++i) EXPECT_EQ(twice.fx[i], once.fx[i]) << i;
    for (std::size_t i = 50; i < half; ++i) {  // comes from elsewhere on the way to the first one
        EXPECT_NEAR(twice.fz[half + i], once.fz[i], 1e-12) << i;
        EXPECT_NEAR(twice.fx[half + i], -once.fx[i], 1e-12) << i;
        EXPECT_NEAR(twice.fy[half + i], -once.fy[i], 1e-12) << i;
    }
}

TEST(Scene, ARepetitionOfARotationGoesAllTheWayRound) {
    const std::string pull = "[[motion]]\ndo = \"shear\"\nto_N = 0.5\nin_s = 0.1\n[[motion]]\ndo = \"rotate\"\nby_deg = ";
    const std::string again = "\nin_s = 0.1\n[[motion]]\ndo = \"repeat\"\ntimes = 3\n";
    EXPECT_EQ(refused(kHead + pull + "360" + again), "");
    EXPECT_NE(refused(kHead + pull + "22.5" + again).find("must end where it began"), std::string::npos);
}

// Gauges differ by 2 %: two samples differ, two scenes with one sample do not.
TEST(Scene, ASampleOfASensorIsTheSameInEveryScene) {
    const auto reads = [](int seed, int serial) {
        const Scene scene = scene_of(
            fmt::format("format = 1\ntitle = \"t\"\nseed = {}\n[[sensor]]\nname = \"a\"\nmodel = \"table\"\nserial = {}\n"
                        "[[motion]]\ndo = \"press\"\nto_N = 1\nin_s = 0.001\n[[motion]]\ndo = \"hold\"\nfor_s = 0.01\n",
                        seed, serial));
        Simulation simulation(scene, "gain_spread,crosstalk");
        return simulation.advance(0).channel[0][5];
    };
    EXPECT_EQ(reads(1, 7), reads(2, 7));
    EXPECT_NE(reads(1, 7), reads(1, 8));
}

TEST(Scene, AnArraySharesAPressAmongItsTaxels) {
    const std::string array =
        "format = 1\ntitle = \"t\"\n[body]\nshape = \"{}\"\nradius_m = 0.0015\n[[sensor]]\nname = \"skin\"\nmodel = "
        "\"table\"\narray = [4, 4]\npitch_m = 0.002\n";
    for (const std::string shape : {"flat", "edge", "sphere"}) {
        const Scene scene =
            scene_of(fmt::format(fmt::runtime(array), shape) +
                     "[[motion]]\ndo = \"move\"\nx_m = 0.0004\ny_m = -0.0003\nin_s = 0.1\n"
                     "[[motion]]\ndo = \"press\"\nto_N = 1\nin_s = 0.1\n[[motion]]\ndo = \"hold\"\nfor_s = 0.1\n");
        ASSERT_EQ(scene.sensors.size(), 16u);
        Simulation simulation(scene, "none");
        double sum = 0;
        int loaded = 0;
        for (std::size_t i = 0; i < 16; ++i) {
            double last = 0;
            for (const Block* b = &simulation.advance(i); b->n > 0; b = &simulation.advance(i))
                last = b->load[kFz][b->n - 1];
            sum += last;
            loaded += last < 0;
        }
        EXPECT_NEAR(sum, -1, 1e-12) << shape;
        EXPECT_EQ(loaded, shape == "flat" ? 16 : shape == "edge" ? 4 : 1) << shape;  // a sphere on SU-8: about 60 um
    }
}

// The five electrodes of a pad are converted in turn, 0.1 s each; its film is sampled with the frame.
TEST(Scene, KnowsTheDelayOfEachChannel) {
    const Scene scene = scene_of(
        "format = 1\ntitle = \"t\"\n[[sensor]]\nname = \"tip\"\nmodel = \"capacitive\"\n"
        "[[motion]]\ndo = \"hold\"\nfor_s = 1\n");
    const Sensor& tip = scene.sensors.front();
    const std::vector<double> delay_s = scene.delay_s(tip);
    ASSERT_EQ(tip.channels, (std::vector<std::string>{"C1", "C2", "C3", "C4", "Cn", "Vp"}));
    ASSERT_EQ(delay_s.size(), 6u);
    for (std::size_t k = 0; k < 5; ++k) EXPECT_NEAR(delay_s[k] - delay_s[5], 0.05 + 0.1 * double(4 - k), 1e-12);
    EXPECT_GT(delay_s[5], 0);  // pad and low pass
    EXPECT_LT(delay_s[5], 0.01);
}

TEST(Scene, SaysWhatIsWrongAndWhere) {
    EXPECT_EQ(refused(kHead + "[[motion]]\ndo = \"pres\"\n").find("scene.toml:11: "), 0u)
        << refused(kHead + "[[motion]]\ndo = \"pres\"\n");
    const std::string hold = "[[motion]]\ndo = \"hold\"\nfor_s = 1\n";
    EXPECT_NE(refused("format = 2\ntitle = \"t\"\n" + hold).find("format"), std::string::npos);
    EXPECT_NE(refused(kHead).find("[[motion]]"), std::string::npos);
    EXPECT_NE(refused("format = 1\ntitle = \"t\"\n" + hold).find("[[sensor]]"), std::string::npos);
    EXPECT_NE(refused(kHead + hold + "[effects.creeep]\namount = 1\n").find("creep"), std::string::npos);
    EXPECT_NE(refused(kHead + hold + "[effects.creep]\namount = 7\n").find("amount"), std::string::npos);
    EXPECT_NE(refused(kHead + hold + "[[sensor]]\nname = \"left\"\nmodel = \"hair\"\n").find("two sensors"),
              std::string::npos);
    EXPECT_EQ(refused(kHead + hold), "");
}

}  // namespace
}  // namespace tactiled::sim
