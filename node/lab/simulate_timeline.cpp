// The chosen effects over the time of a scene: the intervals in which each changed a channel, from a run of the whole
// scene.
#include <algorithm>
#include <cmath>
#include <memory>

#include "node/lab/simulate.hpp"

namespace tactiled::ctl {
namespace {

using sim::Block;

constexpr std::size_t kMaxParts = 400;    // parts of the scene that are checked for a change
constexpr double kSeen = 0.01;            // share of the wanted accuracy that counts as a change
constexpr std::size_t kLaneValues = 361;  // points of a curve over the scene

std::vector<Timeline::Named> name_motions(const std::vector<sim::Segment>& segments, double length_s) {
    std::vector<Timeline::Named> named;
    for (const auto& s : segments) {
        if (s.begin_s >= length_s) break;
        const double end_s = std::min(s.end_s, length_s);
        if (!named.empty() && named.back().kind == s.kind)
            named.back().end_s = end_s;
        else
            named.push_back({s.begin_s, end_s, s.kind});
    }
    return named;
}

std::vector<Timeline::Lane> lanes_of(const sim::Scene& scene, const sim::Sensor& sensor, double length_s) {
    std::vector<Timeline::Lane> lanes{
        {"press", "N", {}}, {"shear", "N", {}}, {"sliding", "m/s", {}}, {"body", "K", {}}, {"surroundings", "K", {}}};
    auto block = std::make_unique<Block>();
    for (std::size_t done = 0; done < kLaneValues; done += block->n) {
        block->n = std::min(Block::kSize, kLaneValues - done);
        for (std::size_t n = 0; n < block->n; ++n) block->t_s[n] = length_s * double(done + n) / double(kLaneValues - 1);
        scene.motion.fill(*block, sensor);
        for (std::size_t n = 0; n < block->n; ++n) {
            lanes[0].value.push_back(-block->load[sim::kFz][n]);
            lanes[1].value.push_back(std::hypot(block->load[sim::kFx][n], block->load[sim::kFy][n]));
            lanes[2].value.push_back(block->speed_m_s[n]);
            lanes[3].value.push_back(block->body_K[n]);
            lanes[4].value.push_back(block->ambient_K[n]);
        }
    }
    std::erase_if(lanes, [](const Timeline::Lane& lane) {
        const auto [min, max] = std::minmax_element(lane.value.begin(), lane.value.end());
        return *min == *max;
    });
    return lanes;
}

}  // namespace

Timeline timeline(const sim::Scene& scene, const std::string& effects, std::size_t number) {
    const sim::Sensor& sensor = scene.sensors[number];
    Timeline result;
    result.length_s = std::min(scene.motion.length_s(), double(scene.samples) / scene.rate_Hz);
    if (!(result.length_s > 0)) result.length_s = scene.motion.length_s();
    result.motions = name_motions(scene.motion.segments(), result.length_s);
    result.lanes = lanes_of(scene, sensor, result.length_s);

    sim::Simulation simulation(scene, effects);
    simulation.measure_shares(true);
    const sim::Choice& choice = simulation.choice(number);
    for (const sim::Decision& d : choice.decisions)
        result.rows.push_back({&d, d.on ? active_s(scene, choice, d) : decltype(Timeline::Row::active_s){}, {}, 0});
    const std::uint64_t blocks = (scene.samples + Block::kSize - 1) / Block::kSize;
    const std::uint64_t per_part = std::max<std::uint64_t>(1, (blocks + kMaxParts - 1) / kMaxParts);
    for (std::uint64_t done = 0; done < scene.samples;) {
        const double begin_s = double(done) / scene.rate_Hz;
        for (std::uint64_t i = 0; i < per_part && done < scene.samples; ++i) done += simulation.advance(number).n;
        const double end_s = double(done) / scene.rate_Hz;
        for (std::size_t d = 0; d < result.rows.size(); ++d) {
            Timeline::Row& row = result.rows[d];
            const double change_N = simulation.shares_N(number)[d];
            row.largest_N = std::max(row.largest_N, change_N);
            if (!row.decision->on ||
                (row.decision->effect->stage != sim::Stage::time && change_N <= kSeen * choice.wanted_N))
                continue;
            if (!row.changed_s.empty() && row.changed_s.back().second == begin_s)
                row.changed_s.back().second = end_s;
            else
                row.changed_s.emplace_back(begin_s, end_s);
        }
        simulation.reset_shares(number);
    }
    result.choice = choice;
    for (std::size_t d = 0; d < result.rows.size(); ++d) result.rows[d].decision = &result.choice.decisions[d];
    std::stable_sort(result.rows.begin(), result.rows.end(), [](const Timeline::Row& a, const Timeline::Row& b) {
        const auto first_s = [](const Timeline::Row& row) {
            return !row.decision->on ? HUGE_VAL : row.changed_s.empty() ? 1e300 : row.changed_s[0].first;
        };
        return first_s(a) < first_s(b);
    });
    return result;
}

}  // namespace tactiled::ctl
