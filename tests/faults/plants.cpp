#include "plants.hpp"

#include <algorithm>
#include <array>

#include "clock.hpp"

namespace tactiled::faults {
namespace {

using Sample = tactiled_sample;

bool is_good(const Sample& s) { return s.quality == TACTILED_GOOD; }

void take_forces(Sample& s, const Sample& from) {
    std::copy_n(from.force_S_N, 3, s.force_S_N);
    std::copy_n(from.raw_force_S_N, 3, s.raw_force_S_N);
}

}  // namespace

std::vector<Plant> plants() {
    std::vector<Plant> all;
    all.push_back(
        {.name = "nobody looks at the age", .found_as = kTooOld, .configuration = {"stale_ms = 20", "stale_ms = 10000"}});
    all.push_back({.name = "a closed link is not told", .found_as = kLate, .discontinuity_is_hidden = true});
    all.push_back(
        {.name = "the last value beside BAD", .found_as = kNoSentinel, .sample = [](Sample& s, const Sample& before) {
             if (s.quality == TACTILED_BAD && is_good(before)) take_forces(s, before);
         }});
    all.push_back({.name = "the last value with a new time",
                   .found_as = kWrongTimestamp,
                   .sample = [](Sample& s, const Sample& before) {
                       if (s.quality != TACTILED_BAD || !is_good(before)) return;
                       const auto sequence = s.sequence;
                       s = before;
                       s.sequence = sequence;
                       s.t_ns = world_ns;
                   }});
    all.push_back(
        {.name = "the force of the frame before", .found_as = kWrongValue, .sample = [](Sample& s, const Sample& before) {
             if (s.sequence % 50 == 7 && is_good(s) && is_good(before)) take_forces(s, before);
         }});
    all.push_back({.name = "a torn sample", .found_as = kWrongValue, .sample = [](Sample& s, const Sample& before) {
                       if (s.sequence % 50 == 7 && is_good(s) && is_good(before))
                           s.raw_force_S_N[2] = s.force_S_N[2] = before.force_S_N[2];
                   }});
    all.push_back({.name = "the epoch stays", .found_as = kUnmarkedDiscontinuity, .sample = [](Sample& s, const Sample&) {
                       s.epoch &= 0xFFFF0000u;
                   }});
    all.push_back({.name = "losses are not counted", .found_as = kUncountedLoss, .sample = [](Sample& s, const Sample&) {
                       s.lost = 0;
                   }});
    all.push_back({.name = "every weakness is GOOD", .found_as = kWrongValue, .sample = [](Sample& s, const Sample&) {
                       if (s.quality == TACTILED_UNCERTAIN) s.quality = TACTILED_GOOD;
                   }});
    all.push_back(
        {.name = "a hundredth is doubted for nothing", .found_as = kFalseAlarm, .sample = [](Sample& s, const Sample&) {
             if (s.sequence % 100 == 60) s.quality = TACTILED_UNCERTAIN;
         }});
    all.push_back({.name = "the heartbeat is the loop's alone", .found_as = kHeartbeat, .node = [](tactiled_node& n) {
                       n.heartbeat = std::uint32_t(world_ns / (100 * kMs));
                   }});
    all.push_back({.name = "two sensors of a link are exchanged", .found_as = kWrongValue, .setup = [](Node& node) {
                       for (auto& binding : node.links[2]->bindings) binding.sensor = std::uint16_t(5 - binding.sensor);
                   }});
    all.push_back({.name = "a sequence number is left out", .found_as = kOutOfOrder, .sample = [](Sample& s, const Sample&) {
                       if (s.sequence > 200) ++s.sequence;
                       if (s.sequence == 201) s.sequence = 202;
                   }});
    all.push_back({.name = "no channel is ever frozen",
                   .found_as = kWrongValue,
                   .configuration = {"frozen_after = 10", "frozen_after = 0"}});
    all.push_back({.name = "any step is possible", .found_as = kWrongValue, .sample = [](Sample& s, const Sample&) {
                       s.reasons &= ~std::uint32_t(TACTILED_STEPPED | TACTILED_GLITCHES);
                       if (s.quality == TACTILED_UNCERTAIN && s.reasons == 0) s.quality = TACTILED_GOOD;
                   }});
    all.push_back(
        {.name = "a tare is in force before it is told", .found_as = kWrongForce, .sample = [](Sample& s, const Sample&) {
             if ((s.reasons & TACTILED_TARING) != 0) s.force_S_N[0] -= 0.02;
         }});
    all.push_back({.name = "a tare is forgotten", .found_as = kWrongForce, .sample = [](Sample& s, const Sample& before) {
                       if (s.tare_count != 0 && before.tare_count == s.tare_count)
                           std::copy_n(s.raw_force_S_N, 3, s.force_S_N);
                   }});
    all.push_back(
        {.name = "a zero is the last reading", .found_as = kWrongForce, .sample = [](Sample& s, const Sample& before) {
             static std::array<double, 3> zero_N{};
             if (s.tare_count == 0 || s.quality == TACTILED_BAD) return;
             if (before.tare_count + 1 == s.tare_count) std::copy_n(s.raw_force_S_N, 3, zero_N.begin());
             for (int k = 0; k < 3; ++k) s.force_S_N[k] = s.raw_force_S_N[k] - zero_N[std::size_t(k)];
         }});
    all.push_back({.name = "a tare under load is taken",
                   .found_as = kWrongForce,
                   .configuration = {"tare_limit_N = 1", "tare_limit_N = 0"}});
    all.push_back(
        {.name = "the tare outlives its calibration", .found_as = kWrongForce, .sample = [](Sample& s, const Sample&) {
             if (s.tare_count == 0 && (s.epoch & 0xFFFF) != 0) s.force_S_N[0] -= 0.02;
         }});
    all.push_back({.name = "the low pass goes on over a break",
                   .found_as = kWrongForce,
                   .sample = [](Sample& s, const Sample& before) {
                       if ((s.state & TACTILED_LOW_PASS) != 0 && is_good(s) && !is_good(before)) s.force_S_N[1] /= 2;
                   }});
    all.push_back({.name = "two sensors of a pair are not compared",
                   .found_as = kWrongValue,
                   .configuration = {"agree_N = 45", "agree_N = 4500"}});
    all.push_back(
        {.name = "a weight stays stable while a jaw is BAD", .found_as = kWrongGrasp, .node = [](tactiled_node& n) {
             static double last_kg = 0.6;
             if (n.grasp.weight_state == TACTILED_WEIGHT_STABLE) last_kg = n.grasp.weight_kg;
             n.grasp.weight_state = TACTILED_WEIGHT_STABLE;
             n.grasp.weight_kg = last_kg;
         }});
    all.push_back({.name = "a weight is half of what hangs", .found_as = kWrongGrasp, .node = [](tactiled_node& n) {
                       n.grasp.weight_kg /= 2;
                   }});
    all.push_back({.name = "a refused reload is not told", .found_as = kReload, .node = [](tactiled_node& n) {
                       n.warning &= ~std::uint32_t(TACTILED_WARN_RELOAD);
                   }});
    all.push_back(
        {.name = "the new calibration is half in force", .found_as = kWrongValue, .sample = [](Sample& s, const Sample&) {
             if ((s.epoch & 0xFFFF) == 1 && s.reasons == 0) s.raw_force_S_N[1] = s.force_S_N[1] = 1.5 * s.force_S_N[1];
         }});
    all.push_back({.name = "a sensor stays broken", .found_as = kNotRecovered, .sample = [](Sample& s, const Sample&) {
                       if ((s.epoch & 0xFFFF) != 0) tactiled_invalidate(&s, TACTILED_STALE);
                   }});
    return all;
}

}  // namespace tactiled::faults
