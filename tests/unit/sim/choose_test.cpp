#include "drivers/sim/choose.hpp"

#include <gtest/gtest.h>

#include "drivers/sim/simulation.hpp"
#include "tests/unit/sim/scene_of.hpp"

namespace tactiled::sim {
namespace {

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

// Two values that differ by next to nothing may be rounded to two neighbours, but only if they differ.
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
    EXPECT_DOUBLE_EQ(reach.rate[kMx], 0.3);  // a moment causes a moment
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

Decision costing(double change_N, double cost_ns) {
    Decision d = decision(change_N, true);
    d.cost_ns = cost_ns;
    return d;
}

Decision with_level(Decision d, double error_N, double cost_ns) {
    d.levels.push_back({"level", error_N, nullptr});
    d.level_cost_ns.push_back(cost_ns);
    return d;
}

double spent_ns(const std::vector<Decision>& decisions) {
    double sum = 0;
    for (const Decision& d : decisions) sum += d.spent_ns();
    return sum;
}

// Two effects of one bound: the more expensive one is left out.
TEST(LeaveOut, WhatCostsMostForTheLeastErrorGoesFirst) {
    std::vector<Decision> decisions{costing(0.01, 10), costing(0.01, 1000)};
    leave_out(decisions, 0.015);
    EXPECT_TRUE(decisions[0].on);
    EXPECT_FALSE(decisions[1].on);
}

// By bound over cost the first would be left out, and then no other could: 100 ns saved instead of 160.
TEST(LeaveOut, TakesTheCheapestSetAndNotTheBestFirstStep) {
    std::vector<Decision> decisions{costing(0.006, 100), costing(0.005, 80), costing(0.005, 80)};
    leave_out(decisions, 0.0101);
    EXPECT_TRUE(decisions[0].on);
    EXPECT_DOUBLE_EQ(spent_ns(decisions), 100);
}

TEST(LeaveOut, TakesALevelWhereTheEffectItselfIsNeeded) {
    std::vector<Decision> decisions{with_level(costing(1, 600), 0.004, 60), costing(0.005, 30)};
    leave_out(decisions, 0.01);
    EXPECT_TRUE(decisions[0].on);
    EXPECT_EQ(decisions[0].level, 0u);
    EXPECT_FALSE(decisions[1].on);
    EXPECT_DOUBLE_EQ(guaranteed_error_N(decisions), 0.009);
    leave_out(decisions, 0.0045);
    EXPECT_EQ(decisions[0].level, 0u);
    EXPECT_TRUE(decisions[1].on);
    leave_out(decisions, 0.003);
    EXPECT_EQ(decisions[0].level, Decision::kItself);
    EXPECT_TRUE(decisions[1].on);
}

// The cheapest of all sets, found by trying each, is cheaper at most by the merging of errors within 1/500 of the
// wanted accuracy; here, with few effects, not at all.
TEST(LeaveOut, FindsTheCheapestOfAllSets) {
    const Stream random(7, "sets");
    for (std::uint64_t trial = 0; trial < 200; ++trial) {
        std::vector<Decision> decisions;
        for (std::uint64_t i = 0; i < 6; ++i) {
            const double bound = std::exp(4 * random.uniform(trial, 4 * i)) / 100,
                         cost = 1 + 100 * random.uniform(trial, 4 * i + 1);
            Decision d = decision(bound, true, 1 + random.uniform(trial, 4 * i + 2));
            d.cost_ns = cost;
            if (i % 2 == 0) d = with_level(d, bound * random.uniform(trial, 4 * i + 3) / 3, cost / 4);
            decisions.push_back(d);
        }
        const double wanted = 0.1 + 0.3 * random.uniform(trial, 63);
        std::vector<Decision> tried = decisions;
        double least = 1e300;
        for (int number = 0; number < 729; ++number) {
            bool possible = true;
            for (int i = 0, rest = number; i < 6; ++i, rest /= 3) {
                Decision& d = tried[std::size_t(i)];
                d.on = rest % 3 != 0;
                d.level = rest % 3 == 2 ? 0 : Decision::kItself;
                possible = possible && (rest % 3 != 2 || !d.levels.empty());
            }
            if (possible && guaranteed_error_N(tried) <= wanted) least = std::min(least, spent_ns(tried));
        }
        leave_out(decisions, wanted);
        EXPECT_LE(guaranteed_error_N(decisions), wanted);
        EXPECT_NEAR(spent_ns(decisions), least, 1e-9 + 0.01 * least) << trial;
    }
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

// No effect that is on could be left out, or used at a cheaper level, with the others unchanged.
TEST(Choose, AutoLeavesOutAsMuchAsItCan) {
    Scene scene = scene_of(kStill);
    const Extent extent = scene.motion.extent(scene.sensors[0]);
    for (const double wanted_N : {1e-4, 1e-3, 5e-3, 0.025}) {
        scene.wanted_accuracy_N = wanted_N;
        Choice choice = choose(scene, scene.sensors[0], extent, "auto");
        for (Decision& d : choice.decisions) {
            if (!d.on) continue;
            const std::size_t level = d.level;
            const double spent = d.spent_ns();
            d.on = false;
            EXPECT_GT(guaranteed_error_N(choice.decisions), wanted_N) << d.effect->name;
            d.on = true;
            for (d.level = 0; d.level < d.levels.size(); ++d.level)
                if (d.spent_ns() < spent) {
                    EXPECT_GT(guaranteed_error_N(choice.decisions), wanted_N) << d.effect->name << ":" << d.level;
                }
            d.level = level;
        }
    }
}

// A list runs exactly the effects that it names: the names and levels that auto selected give the same bits.
TEST(Choose, AListOfEffectsAndLevelsIsWhatAutoTook) {
    Scene scene = scene_of(
        "format = 1\ntitle = \"t\"\n[[sensor]]\nname = \"left\"\nmodel = \"capacitive\"\n[[motion]]\ndo = "
        "\"press\"\nto_N = 3\nin_s = 0.2\n[[motion]]\ndo = \"shear\"\nto_N = 1\nin_s = 0.2\n");
    const Choice choice = choose(scene, scene.sensors[0], scene.motion.extent(scene.sensors[0]), "auto");
    std::string list;
    bool any = false;
    for (const Decision& d : choice.decisions) {
        if (!d.on) continue;
        list += (list.empty() ? "" : ",") + std::string(d.effect->name);
        if (d.level == Decision::kItself) continue;
        any = true;
        list += ":" + std::string(d.levels[d.level].name);
    }
    EXPECT_TRUE(any) << "no level is worth it here: " << list;
    Simulation automatic(scene, "auto"), listed(scene, list);
    for (const Block* a = &automatic.advance(0); a->n > 0; a = &automatic.advance(0)) {
        const Block& b = listed.advance(0);
        for (std::size_t k = 0; k < scene.sensors[0].n(); ++k)
            for (std::size_t n = 0; n < a->n; ++n) ASSERT_EQ(a->channel[k][n], b.channel[k][n]);
    }
}

TEST(Choose, ALevelThatIsNotThereIsRefused) {
    const Scene scene = scene_of(kStill);
    const Extent extent = scene.motion.extent(scene.sensors[0]);
    EXPECT_THROW(choose(scene, scene.sensors[0], extent, "creep:cubic"), SetupError);
    EXPECT_THROW(choose(scene, scene.sensors[0], extent, "noise:cubic"), SetupError);
    EXPECT_NO_THROW(choose(scene, scene.sensors[0], extent, "creep:1_axis"));
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
