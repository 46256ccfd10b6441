// The parts of a scene, the bounds of the effects in each part, and the choice of effects that are suspended ("rest").
#include <algorithm>
#include <cmath>

#include "drivers/sim/choose.hpp"

namespace tactiled::sim {
namespace {

constexpr std::size_t kMaxParts = 16;
constexpr std::uint64_t kMinSamples = 4 * Block::kSize;

// Maximum difference between the actual and the nominal time of a sample, by the effects of time that concern the sensor.
double margin_s(const Scene& scene, const std::vector<Decision>& decisions) {
    double stretch = 1, slack_s = 0;
    for (const Decision& d : decisions)
        if (d.effect->stage == Stage::time) {
            stretch *= d.bound.stretch;
            slack_s += d.bound.slack_s;
        }
    return (stretch - 1) * double(scene.samples) / scene.rate_Hz + slack_s + 1.5 / scene.rate_Hz;
}

// Bounds of one part. An instant effect is bounded over the part alone. Other effects have a memory, so they are bounded
// over the scene up to the end of the part. The same holds for the changes by the effects before them.
void bound_part(const Scene& scene, const Sensor& sensor, const Part& part, std::vector<Decision>& decisions) {
    Extent here = scene.motion.extent(sensor, part.first_segment, part.last_segment);
    Extent so_far = scene.motion.extent(sensor, 0, part.last_segment);
    Before before_here, before_so_far;
    for (Decision& d : decisions) {
        Setting setting = scene.setting(d.number(), sensor, so_far);
        setting.before = before_so_far;
        // Effects of time and of the link have the bound of the whole scene.
        const bool whole = d.effect->stage == Stage::time || d.effect->stage == Stage::link;
        const Bound bound = whole ? d.bound : d.effect->bound(setting);
        Bound own = bound;
        if (d.effect->instant) {
            Setting alone = scene.setting(d.number(), sensor, here);
            alone.before = before_here;
            own = d.effect->bound(alone);
        }
        d.part_N.push_back(own.change_N);
        pass_on(own, d.effect->stage, here, before_here);
        pass_on(bound, d.effect->stage, so_far, before_so_far);
    }
}

// Returns the largest error at the end of the chain over all parts. Outside the samples of the parts no effect is suspended,
// and the bounds are those of the whole scene. An effect with a memory passes on the largest error so far.
double error_with_rests_N(const std::vector<Decision>& decisions, std::size_t parts) {
    std::vector<double> error(parts, 0);
    double between = 0;
    for (const Decision& d : decisions) {
        const auto hand_on = [&](double e) { return e > 0 ? e * d.bound.gain + d.bound.jump_N : 0; };
        const double added = d.error_N();
        double before = between;  // the largest error before the effect so far
        for (std::size_t k = 0; k < parts; ++k) {
            before = std::max(before, error[k]);
            const double in = d.effect->instant ? error[k] : before;
            if (!d.on || d.rests[k])
                error[k] += std::min(d.part_N[k], d.bound.change_N);
            else
                error[k] = hand_on(in) + added;
        }
        between = d.on ? hand_on(d.effect->instant ? between : before) + added : between + added;
    }
    for (const double e : error)
        if (!(e <= between)) between = e;
    return between;
}

}  // namespace

std::vector<Part> parts_of(const Scene& scene, double margin_s) {
    const auto& segments = scene.motion.segments();
    std::vector<Part> parts;
    for (std::size_t i = 0; i < segments.size(); ++i) parts.push_back({i, i, segments[i].begin_s, segments[i].end_s, 0, 0});
    const double shortest_s = double(kMinSamples) / scene.rate_Hz + 2 * margin_s;
    const auto length_s = [](const Part& p) { return p.end_s - p.begin_s; };
    while (parts.size() > 1) {
        const auto least = std::ranges::min_element(parts, {}, length_s);
        if (parts.size() <= kMaxParts && length_s(*least) >= shortest_s) break;
        const auto next =
            least + 1 == parts.end() || (least != parts.begin() && length_s(*(least - 1)) < length_s(*(least + 1)))
                ? least - 1
                : least;
        next->last_segment = (next + 1)->last_segment;
        next->end_s = (next + 1)->end_s;
        parts.erase(next + 1);
    }
    for (Part& part : parts) {
        const auto blocks = [&](double samples) { return std::uint64_t(std::max(0.0, samples) / double(Block::kSize)); };
        part.first_sample = (blocks(std::ceil((part.begin_s + margin_s) * scene.rate_Hz)) + 1) * Block::kSize;
        part.end_sample = blocks(std::floor((part.end_s - margin_s) * scene.rate_Hz)) * Block::kSize;
        if (part.begin_s <= 0) part.first_sample = 0;  // nothing is before the scene
        part.end_sample = std::max(std::min(part.end_sample, scene.samples), part.first_sample);
    }
    return parts;
}

std::vector<std::pair<double, double>> active_s(const Scene& scene, const Choice& choice, const Decision& decision) {
    std::vector<std::pair<double, double>> spans;
    double begin_s = 0;
    const auto add = [&](double end_s) {
        if (end_s > begin_s) spans.emplace_back(begin_s, end_s);
    };
    for (std::size_t k = 0; k < choice.parts.size(); ++k) {
        if (!decision.rests[k]) continue;
        add(double(choice.parts[k].first_sample) / scene.rate_Hz);
        begin_s = double(choice.parts[k].end_sample) / scene.rate_Hz;
    }
    add(double(scene.samples) / scene.rate_Hz);
    return spans;
}

void let_rest(const Scene& scene, const Sensor& sensor, Choice& choice) {
    auto& decisions = choice.decisions;
    const auto may_rest = [](const Decision& d) { return d.on && d.effect->instant; };
    if (std::none_of(decisions.begin(), decisions.end(), may_rest)) return;
    std::vector<Part> parts = parts_of(scene, margin_s(scene, decisions));
    if (parts.size() < 2) return;
    for (const Part& part : parts) bound_part(scene, sensor, part, decisions);
    for (Decision& d : decisions) d.rests.assign(parts.size(), false);

    bool any = false;
    for (const std::size_t i : by_cost(decisions)) {
        Decision& d = decisions[i];
        if (!may_rest(d)) continue;
        std::uint64_t resting = 0;
        for (std::size_t k = 0; k < parts.size(); ++k) {
            const std::uint64_t samples = parts[k].end_sample - parts[k].first_sample;
            if (samples == 0) continue;
            d.rests[k] = true;
            if (error_with_rests_N(decisions, parts.size()) <= choice.wanted_N)
                resting += samples;
            else
                d.rests[k] = false;
        }
        d.active_share = 1 - double(resting) / double(std::max<std::uint64_t>(scene.samples, 1));
        if (resting > 0) d.why = "needed in a part of the scene";
        any |= resting > 0;
    }
    choice.guaranteed_N = std::max(choice.guaranteed_N, error_with_rests_N(decisions, parts.size()));
    if (any)
        choice.parts = std::move(parts);
    else
        for (Decision& d : decisions) d.rests.clear();
}

}  // namespace tactiled::sim
