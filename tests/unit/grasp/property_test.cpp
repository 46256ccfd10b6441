// For any input in any order: every output is valid, and no bad value seems good.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <bit>
#include <cmath>

#include "tests/unit/grasp/hand.hpp"

namespace tactiled::grasp {
namespace {

double any_double() {
    switch (*rc::gen::inRange(0, 6)) {
        case 0: return std::bit_cast<double>(*rc::gen::arbitrary<std::uint64_t>());
        case 1: return 0;
        default: return *rc::gen::inRange(-4000, 4000) * 1e-3;
    }
}

void expect_legal(const tactiled_grasp& g, const tactiled_grasp& before) {
    RC_ASSERT(g.state <= TACTILED_GRIP_LOST || g.state == TACTILED_GRIP_UNKNOWN);
    RC_ASSERT(g.weight_state <= TACTILED_WEIGHT_NOT_OBSERVABLE);
    const bool has_weight = g.weight_state == TACTILED_WEIGHT_STABLE || g.weight_state == TACTILED_WEIGHT_ESTIMATING;
    RC_ASSERT(std::isfinite(g.weight_kg) || std::isnan(g.weight_kg));
    RC_ASSERT(has_weight || std::isnan(g.weight_kg));
    if (g.weight_state == TACTILED_WEIGHT_STABLE) RC_ASSERT(std::isfinite(g.weight_kg) && g.weight_sd_kg > 0);
    RC_ASSERT(std::isnan(g.weight_sd_kg) || (std::isfinite(g.weight_sd_kg) && g.weight_sd_kg >= 0));
    RC_ASSERT(g.object_id == 0 || g.weight_state == TACTILED_WEIGHT_STABLE);
    RC_ASSERT(g.slips >= before.slips && g.grasps >= before.grasps && g.t_ns >= before.t_ns);
    for (int j = 0; j < 2; ++j) {
        RC_ASSERT(g.slip_state[j] <= TACTILED_SLIP_GROSS || g.slip_state[j] == TACTILED_SLIP_UNKNOWN);
        RC_ASSERT(!std::isinf(g.friction_use[j]));
    }
    RC_ASSERT(!(g.recommended_grip_N < 0));
    RC_ASSERT(!std::isinf(g.grip_N) && !std::isinf(g.friction) && !std::isinf(g.recommended_grip_N));
}

RC_GTEST_PROP(GraspProperty, AnySamplesInAnyOrderGiveALegalState, ()) {
    Grasp grasp(two_jaws());
    const Object taught[] = {{1, "a", 0.1, 0.01}};
    grasp.objects(taught);
    tactiled_grasp before = grasp.state();
    std::uint64_t t_ns = 1'000'000'000;
    const int n = *rc::gen::inRange(1, 200);
    for (int i = 0; i < n; ++i) {
        JawSample s;
        s.t_ns = *rc::gen::inRange(0, 20) == 0 ? *rc::gen::arbitrary<std::uint64_t>()
                                               : t_ns += std::uint64_t(*rc::gen::inRange(0, 30'000'000));
        for (double& f : s.force_S_N) f = any_double();
        for (double& f : s.sd_N) f = std::abs(any_double());
        s.quality = tactiled_quality(*rc::gen::inRange(1, 4));
        s.reasons = *rc::gen::arbitrary<std::uint32_t>() & 0xFFFF;
        switch (*rc::gen::inRange(0, 20)) {
            case 0: grasp.gravity({any_double(), any_double(), any_double()}); break;
            case 1: grasp.acceleration({any_double(), any_double(), any_double()}, t_ns); break;
            case 2: (void)grasp.start_weighing(); break;
            case 3: (void)grasp.known_weight(any_double()); break;
            case 4: (void)grasp.zero_weight(); break;
            case 5: grasp.slip_sensitivity(any_double()); break;
            case 6: grasp.weigh_window(any_double()); break;
            default: break;
        }
        grasp.sample(std::size_t(*rc::gen::inRange(0, 3)), s);
        const tactiled_grasp now = grasp.state();
        expect_legal(now, before);
        before = now;
    }
}

RC_GTEST_PROP(GraspProperty, NoWeightLooksGoodWhileAJawIsBad, ()) {
    Hand hand;
    hand.close();
    const double begin_s = *rc::gen::inRange(0, 800) * 1e-3, for_s = *rc::gen::inRange(1, 300) * 1e-3;
    const auto jaw = std::size_t(*rc::gen::inRange(0, 2));
    const double from_s = hand.t_s() + begin_s, to_s = from_s + for_s;
    hand.spoil = [&](std::size_t j, JawSample& s) {
        if (j == jaw && hand.t_s() >= from_s && hand.t_s() < to_s) s.quality = TACTILED_BAD;
    };
    hand.each = [&](const tactiled_grasp& g) {
        if (hand.t_s() < from_s || hand.t_s() >= to_s) return;
        RC_ASSERT(g.state == TACTILED_GRIP_UNKNOWN);
        RC_ASSERT(std::isnan(g.weight_kg) && g.weight_state != TACTILED_WEIGHT_STABLE);
    };
    hand.lift(0.1).stay(0.6);
}

}  // namespace
}  // namespace tactiled::grasp
