// Checks the record of the grasp.
#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "clock.hpp"
#include "witness.hpp"

namespace tactiled::faults {
namespace {

constexpr std::uint64_t kWeightMemoryNs = 300 * kMs;

}  // namespace

void Witness::look_at_grasp() {
    if (!readers_[0].is_attached()) return;
    const SegmentView segment = readers_[0].segment();
    tactiled_node node{};
    if (!segment.latest_node(node) || node.t_ns == node_.t_ns) return;
    bool all_known = true, all_good = true;
    for (unsigned i = 0; i < kSensors; ++i) {
        tactiled_sample s{};
        const tactiled_ring& ring = segment.sensor(i).ring;
        if (!is_jaw(i) || tactiled_ring_read(segment.base(), &ring, std::uint32_t(node.count[i] - 1), &s, sizeof s) == 0)
            continue;
        all_known &= s.quality != TACTILED_BAD;
        all_good &= s.quality == TACTILED_GOOD;
    }
    const tactiled_grasp& g = node.grasp;
    if (!all_good) doubtful_until_ns_ = world_ns + kWeightMemoryNs;
    if (!all_known && (g.state != TACTILED_GRIP_UNKNOWN || g.weight_state != TACTILED_WEIGHT_NONE ||
                       !std::isnan(g.weight_kg) || !std::isnan(g.grip_N)))
        findings_.add(kWrongGrasp, 2,
                      fmt::format("state {}, {} kg, state {}, and a jaw is BAD", g.state, g.weight_kg, g.weight_state));
    if (g.weight_state == TACTILED_WEIGHT_STABLE && !all_good)
        findings_.add(kWrongGrasp, 2, fmt::format("{} kg is stable, and a jaw is not GOOD", g.weight_kg));
    const bool same_daemon = std::exchange(node_epoch_, segment.header().epoch) == segment.header().epoch;
    if (same_daemon && (g.grasps < node_.grasp.grasps || g.slips < node_.grasp.slips))
        findings_.add(kWrongGrasp, 2, fmt::format("{} grasps after {}", g.grasps, node_.grasp.grasps));
    if (g.weight_state == TACTILED_WEIGHT_STABLE) judge_weight(node);
    node_ = node;
}

// The object hangs equally on both jaws.
void Witness::judge_weight(const tactiled_node& node) {
    ++findings_.stable_weights;
    if (world_ns < doubtful_until_ns_) return;
    constexpr double kG_m_s2 = 9.81, kSlack = 0.1;
    double mass_kg = 0;
    for (unsigned i = 0; i < kSensors; ++i) {
        if (!is_jaw(i)) continue;
        const tactiled_sample s = latest(i);
        if (s.quality != TACTILED_GOOD || wanted_gain_[i] != 0 || !is_held(s.device_sequence)) return;
        mass_kg += gain_[i] * (level_of(i, s.device_sequence, 0) - place_of(i, 0)) / kG_m_s2;
    }
    if (std::abs(node.grasp.weight_kg - mass_kg) > kSlack * mass_kg)
        findings_.add(kWrongGrasp, 2, fmt::format("{} kg is stable, {} kg hangs", node.grasp.weight_kg, mass_kg));
}

}  // namespace tactiled::faults
