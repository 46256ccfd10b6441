// Effects that rest in parts of a scene: where they may, and that the guarantee holds there.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "drivers/sim/simulation.hpp"
#include "tests/unit/sim/random_scene.hpp"
#include "tests/unit/sim/scene_of.hpp"

namespace tactiled::sim {
namespace {

// A pad that is touched after four seconds of rest, and is at rest again at the end.
Scene touched_late(double wanted_N) {
    return scene_of(fmt::format(R"(format = 1
title = "touched late"
wanted_accuracy_N = {}
[[sensor]]
name = "pad"
model = "capacitive"
[[motion]]
do = "hold"
for_s = 4
[[motion]]
do = "press"
to_N = 2
in_s = 0.5
[[motion]]
do = "shear"
to_N = 1
in_s = 0.5
[[motion]]
do = "press"
to_N = 0
in_s = 0.5
[[motion]]
do = "hold"
for_s = 2
)",
                                wanted_N));
}

const Decision& decision_on(const Choice& choice, std::string_view effect) {
    for (const Decision& d : choice.decisions)
        if (d.effect->name == effect) return d;
    throw std::logic_error("no such effect");
}

TEST(Parts, CoverTheSceneAndKeepAwayFromTheirBorders) {
    const Scene scene = touched_late(0);
    const auto parts = parts_of(scene, 0.01);
    ASSERT_GE(parts.size(), 3u);
    for (std::size_t k = 0; k < parts.size(); ++k) {
        EXPECT_EQ(parts[k].first_segment, k == 0 ? 0 : parts[k - 1].last_segment + 1);
        if (k > 0) { EXPECT_GE(double(parts[k].first_sample), (parts[k].begin_s + 0.01) * scene.rate_Hz); }
        EXPECT_LE(double(parts[k].end_sample), (parts[k].end_s - 0.01) * scene.rate_Hz);
        EXPECT_EQ(parts[k].first_sample % Block::kSize, 0u);
        EXPECT_TRUE(parts[k].end_sample % Block::kSize == 0 || parts[k].end_sample == scene.samples);
    }
    EXPECT_EQ(parts.back().last_segment, scene.motion.segments().size() - 1);
}

TEST(Parts, AnEffectOfTheLoadRestsWhileNothingTouches) {
    const Scene scene = touched_late(0.01);
    const Simulation simulation(scene, "auto");
    const Choice& choice = simulation.choice(0);
    std::size_t resting = 0;
    for (const Decision& d : choice.decisions)
        if (d.on && d.active_share < 1) {
            ++resting;
            EXPECT_TRUE(d.effect->instant) << d.effect->name;
            EXPECT_LT(d.active_share, 0.6) << d.effect->name;
            EXPECT_GT(active_s(scene, choice, d).front().first, 3.5) << d.effect->name;
            EXPECT_LT(d.spent_ns(), d.cost_ns);
        }
    EXPECT_GE(resting, 1u);
    EXPECT_LT(decision_on(choice, "exact_overlap").active_share, 1);
}

// An effect that depends on earlier samples would come out of a rest with another state.
RC_GTEST_PROP(Parts, InstantEffectsGiveTheSameWhateverCameBefore, ()) {
    const RandomScene random = random_scene();
    const Scene scene = random.scene();
    const auto extent = scene.motion.extent(scene.sensors[0]);
    for (std::size_t i = 0; i < chain().size(); ++i) {
        const EffectEntry& effect = *chain()[i];
        if (!effect.instant || (effect.models >> unsigned(scene.sensors[0].model) & 1u) == 0) continue;
        const Setting setting = scene.setting(i, scene.sensors[0], extent);
        const auto all = effect.make(setting), late = effect.make(setting);
        auto block = std::make_unique<Block>();
        for (std::uint64_t first = 0; first < 4; ++first) {
            *block = Block{};
            block->first = first * Block::kSize;
            block->n = Block::kSize;
            const Stream noise(17 + first, "any block");
            for (std::size_t n = 0; n < block->n; ++n) {
                block->t_s[n] = double(block->first + n) / scene.rate_Hz;
                for (std::size_t axis = 0; axis < kAxes; ++axis) {
                    block->load[axis][n] = noise.uniform(n, axis) - (axis == kFz ? 1.5 : 0.5);
                    block->drive[axis][n] = noise.uniform(n, 10 + axis) - 0.5;
                }
                block->radius_m[n] = 1e-4;
                block->speed_m_s[n] = noise.uniform(n, 20) - 0.5;
                for (std::size_t k = 0; k < scene.sensors[0].n(); ++k)
                    block->channel[k][n] = scene.sensors[0].zero[k] + scene.sensors[0].per_N[k] * noise.uniform(n, 30 + k);
            }
            Block other = *block;
            all->apply(*block);
            if (first < 3) continue;
            late->apply(other);
            for (std::size_t n = 0; n < block->n; ++n) {
                for (std::size_t k = 0; k < scene.sensors[0].n(); ++k)
                    if (block->channel[k][n] != other.channel[k][n]) RC_FAIL(std::string(effect.name));
                for (std::size_t axis = 0; axis < kAxes; ++axis)
                    if (block->load[axis][n] != other.load[axis][n] || block->drive[axis][n] != other.drive[axis][n])
                        RC_FAIL(std::string(effect.name));
            }
        }
    }
}

// In each part, with all effects at work, no instant effect changes a channel by more than its bound there.
RC_GTEST_PROP(Parts, BoundsHoldSampleBySample, ()) {
    const RandomScene random = random_scene();
    Scene scene = random.scene();
    scene.wanted_accuracy_N = scene.sensors[0].resolution_N * *rc::gen::element(0.01, 0.1, 0.5, 2.0, 10.0);
    Simulation chosen(scene, "auto"), all(scene, "all");
    all.measure_shares(true);
    const Choice& choice = chosen.choice(0);
    if (choice.parts.empty()) return;
    RC_LOG(random.text());
    std::size_t part = 0;
    for (const Block* block = &all.advance(0); block->n > 0; block = &all.advance(0)) {
        while (part < choice.parts.size() && block->first >= choice.parts[part].end_sample) ++part;
        if (part == choice.parts.size()) break;
        const bool within = block->first >= choice.parts[part].first_sample;
        for (std::size_t d = 0; within && d < choice.decisions.size(); ++d) {
            const Decision& decision = choice.decisions[d];
            const double N = all.shares_N(0)[d];
            if (decision.effect->instant && !(N <= decision.part_N[part] * kRounding + kNothing_N))
                RC_FAIL(fmt::format("{} made {} N at {} s, its bound there is {} N", decision.effect->name, N, block->t_s[0],
                                    decision.part_N[part]));
        }
        all.reset_shares(0);
    }
}

}  // namespace
}  // namespace tactiled::sim
