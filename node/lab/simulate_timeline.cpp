// The effects that a scene would call for if it ended earlier, segment by segment. They come on one by one.
#include <algorithm>
#include <cmath>
#include <memory>

#include "node/lab/simulate.hpp"

namespace tactiled::ctl {
namespace {

using sim::Block;

constexpr std::size_t kMaxEnds = 200;     // segments at whose end the choice is made; of more, evenly some
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

Timeline timeline(const sim::Scene& scene, const sim::Sensor& sensor) {
    const auto& segments = scene.motion.segments();
    Timeline result;
    result.length_s = std::min(scene.motion.length_s(), double(scene.samples) / scene.rate_Hz);
    if (!(result.length_s > 0)) result.length_s = scene.motion.length_s();
    result.motions = name_motions(segments, result.length_s);
    result.lanes = lanes_of(scene, sensor, result.length_s);

    sim::Scene cut = scene;  // the scene so far
    const std::size_t step = (segments.size() + kMaxEnds - 1) / kMaxEnds;
    double begin_s = 0;
    for (std::size_t i = 0; i < segments.size() && begin_s < result.length_s; i += step) {
        const std::size_t last = std::min(i + step, segments.size()) - 1;
        const double end_s = std::min(segments[last].end_s, result.length_s);
        cut.samples = std::uint64_t(std::llround(end_s * scene.rate_Hz));
        const sim::Extent extent = scene.motion.extent(sensor, last);
        const sim::Choice choice = sim::choose(cut, sensor, extent, "auto");
        for (std::size_t d = 0; d < choice.decisions.size(); ++d) {
            const sim::Decision& decision = choice.decisions[d];
            if (result.rows.size() <= d) result.rows.push_back({decision.effect, {}, 0, ""});
            Timeline::Row& row = result.rows[d];
            row.bound_N = decision.bound.change_N;
            row.why = decision.why;
            if (!decision.on) continue;
            if (!row.on_s.empty() && row.on_s.back().second == begin_s)
                row.on_s.back().second = end_s;
            else
                row.on_s.emplace_back(begin_s, end_s);
        }
        begin_s = end_s;
    }
    std::stable_sort(result.rows.begin(), result.rows.end(), [](const Timeline::Row& a, const Timeline::Row& b) {
        const auto first_s = [](const Timeline::Row& row) { return row.on_s.empty() ? HUGE_VAL : row.on_s[0].first; };
        return first_s(a) < first_s(b);
    });
    return result;
}

}  // namespace tactiled::ctl
