#include "drivers/sim/choose.hpp"

#include <gtest/gtest.h>

namespace tactiled::sim {
namespace {

Scene scene_of(const std::string& text) {
    Problems problems;
    return read_scene(Options::parse_text(text, "scene.toml", problems), problems);
}

const std::string kStill =
    "format = 1\ntitle = \"t\"\n[[sensor]]\nname = \"left\"\nmodel = \"table\"\n[[motion]]\ndo = \"press\"\nto_N = 1\nin_s "
    "= 1\n";

Decision decision(double change_N, bool on, double gain = 1, double jump_N = 0) {
    static const EffectEntry& any = *find_effect("creep");
    return {&any, {change_N, gain, jump_N}, on, ""};
}

TEST(GuaranteedError, IsTheSumOfWhatIsLeftOut) {
    EXPECT_EQ(guaranteed_error_N({}), 0);
    EXPECT_DOUBLE_EQ(guaranteed_error_N({decision(0.01, false), decision(9, true), decision(0.02, false)}), 0.03);
}

TEST(GuaranteedError, GrowsByTheGainOfWhatComesAfter) {
    EXPECT_DOUBLE_EQ(guaranteed_error_N({decision(0.01, false), decision(0, true, 2)}), 0.02);
    EXPECT_DOUBLE_EQ(guaranteed_error_N({decision(0, true, 2), decision(0.01, false)}), 0.01);
}

// Two values that differ by next to nothing may be rounded to two neighbours: but only if they differ.
TEST(GuaranteedError, JumpsAtARoundingOnlyWhereSomethingWasLeftOutBefore) {
    EXPECT_DOUBLE_EQ(guaranteed_error_N({decision(0.001, false), decision(0.025, true, 1, 0.05)}), 0.051);
    EXPECT_DOUBLE_EQ(guaranteed_error_N({decision(0, false), decision(0.025, true, 1, 0.05)}), 0);
    EXPECT_DOUBLE_EQ(guaranteed_error_N({decision(0.025, true, 1, 0.05), decision(0.001, false)}), 0.001);
}

TEST(PassOn, AMaterialReachesFurtherAndMovesFaster) {
    Extent reach;
    reach.max = reach.span = {0, 0, 1, 0, 0};
    reach.rate = {0, 0, 2, 0, 0};
    reach.jump = {0, 0, 0.5, 0, 0};
    Before before;
    pass_on({.change_N = 0.1, .load = {0, 0, 0.1, 0, 0}, .load_gain = 1.5}, Stage::material, reach, before);
    EXPECT_DOUBLE_EQ(reach.max[kFz], 1.1);
    EXPECT_DOUBLE_EQ(reach.span[kFz], 1.2);
    EXPECT_DOUBLE_EQ(reach.rate[kFz], 3);
    EXPECT_DOUBLE_EQ(reach.jump[kFz], 0.75);
    EXPECT_DOUBLE_EQ(before.load[kFz], 0.1);
    EXPECT_EQ(before.max_N, 0);
    EXPECT_FALSE(reach.reverses);
}

TEST(PassOn, ATurnedSensorSeesOneForceMoveInAnother) {
    Extent reach;
    reach.rate = {0, 0, 2, 0, 3};
    reach.jump = {0, 0, 0.5, 0, 0};
    Before before;
    pass_on({.change_N = 0.1, .load = {0.1, 0, 0, 0, 0}, .coupling = 0.1}, Stage::contact, reach, before);
    EXPECT_DOUBLE_EQ(reach.rate[kFx], 0.2);
    EXPECT_DOUBLE_EQ(reach.jump[kFx], 0.05);
    EXPECT_DOUBLE_EQ(reach.rate[kMx], 0.3);  // of a moment comes a moment
    EXPECT_DOUBLE_EQ(reach.back[kFx], 0.2);
}

TEST(PassOn, WhatMovesByItselfMayComeAtOnceAndGo) {
    Extent reach;
    Before before;
    pass_on({.change_N = 0.1, .own_N = 0.1, .load = {0, 0, 0.1, 0, 0}}, Stage::contact, reach, before);
    EXPECT_TRUE(reach.reverses);
    EXPECT_DOUBLE_EQ(reach.added[kFz], 0.1);
    EXPECT_DOUBLE_EQ(reach.change(kFz, 0), 0.2);
}

TEST(PassOn, ChannelsMoveWithTheirLoadByTheGainsAndBesidesByWhatMovesByItself) {
    const Scene scene = scene_of(kStill);
    const Extent still;
    Setting setting = scene.setting(0, scene.sensors[0], still);
    Extent reach;
    pass_on({.change_N = 0.1, .own_N = 0.1, .own_rate_N_s = 0.5}, Stage::transducer, reach, setting.before);
    pass_on({.change_N = 0.2, .gain = 2}, Stage::transducer, reach, setting.before);
    EXPECT_DOUBLE_EQ(setting.before.max_N, 0.3);
    EXPECT_DOUBLE_EQ(setting.before.gain, 2);
    EXPECT_DOUBLE_EQ(setting.before.change_N(setting, 0.1), 2 * 0.05);
    EXPECT_DOUBLE_EQ(setting.before.change_N(setting, 100), 2 * 0.2);
}

// Two effects of one bound: the dear one goes.
TEST(LeaveOut, WhatCostsMostForTheLeastErrorGoesFirst) {
    EffectEntry dear = *find_effect("creep"), cheap = dear;
    dear.instructions = 1000;
    cheap.instructions = 10;
    std::vector<Decision> decisions{{&cheap, {.change_N = 0.01}, true, ""}, {&dear, {.change_N = 0.01}, true, ""}};
    leave_out(decisions, 0.015);
    EXPECT_TRUE(decisions[0].on);
    EXPECT_FALSE(decisions[1].on);
}

TEST(Choose, AutoKeepsTheWantedAccuracyAndLeavesOutNothingThatItDoesNotState) {
    const Scene scene = scene_of(kStill);
    const Extent extent = scene.motion.extent(scene.sensors[0]);
    for (const double wanted_N : {1e-6, 1e-3, 5e-3, 0.025, 1.0}) {
        Scene strict = scene;
        strict.wanted_accuracy_N = wanted_N;
        const Choice choice = choose(strict, scene.sensors[0], extent, "auto");
        EXPECT_LE(choice.guaranteed_N, wanted_N);
        EXPECT_DOUBLE_EQ(choice.guaranteed_N, guaranteed_error_N(choice.decisions));
        for (const Decision& d : choice.decisions) EXPECT_FALSE(d.why.empty()) << d.effect->name;
    }
}

// No effect that is on could be left out with the others as they are.
TEST(Choose, AutoLeavesOutAsMuchAsItCan) {
    Scene scene = scene_of(kStill);
    const Extent extent = scene.motion.extent(scene.sensors[0]);
    for (const double wanted_N : {1e-4, 1e-3, 5e-3, 0.025}) {
        scene.wanted_accuracy_N = wanted_N;
        Choice choice = choose(scene, scene.sensors[0], extent, "auto");
        for (Decision& d : choice.decisions) {
            if (!d.on) continue;
            d.on = false;
            EXPECT_GT(guaranteed_error_N(choice.decisions), wanted_N) << d.effect->name;
            d.on = true;
        }
    }
}

TEST(Choose, AStricterRequestSelectsMore) {
    Scene scene = scene_of(kStill);
    const Extent extent = scene.motion.extent(scene.sensors[0]);
    const auto on = [&](double wanted_N) {
        scene.wanted_accuracy_N = wanted_N;
        const auto choice = choose(scene, scene.sensors[0], extent, "auto");
        return std::count_if(choice.decisions.begin(), choice.decisions.end(), [](const Decision& d) { return d.on; });
    };
    EXPECT_EQ(on(1e4), 0);
    EXPECT_GT(on(1e-4), on(0.1));
}

TEST(Choose, AWrongNameIsRefusedWithTheNearest) {
    const Scene scene = scene_of(kStill);
    const Extent extent = scene.motion.extent(scene.sensors[0]);
    const auto refused = [&](const std::string& request) -> std::string {
        try {
            choose(scene, scene.sensors[0], extent, request);
        } catch (const SetupError& e) { return e.what(); }
        return "";
    };
    EXPECT_EQ(refused("crep"), "no effect \"crep\"; did you mean \"creep\"?");
    EXPECT_NE(refused("creep,"), "");
    EXPECT_NE(refused(""), "");
    EXPECT_EQ(refused("noise,creep"), "");
}

TEST(Choose, AListTurnsOnWhatItNamesAndNothingElse) {
    const Scene scene = scene_of(kStill);
    for (const Decision& d : choose(scene, scene.sensors[0], scene.motion.extent(scene.sensors[0]), "creep").decisions)
        EXPECT_EQ(d.on, d.effect->name == "creep");
}

}  // namespace
}  // namespace tactiled::sim
