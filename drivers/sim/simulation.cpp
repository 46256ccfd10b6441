#include "drivers/sim/simulation.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "drivers/clock.hpp"

namespace tactiled::sim {
namespace {

// Returns the linear step before each stage: sample times, motion, and the first-order response of material and transducer,
// which an array has for each taxel.
std::unique_ptr<Effect> before(Stage stage, const Scene& scene, const Sensor& sensor) {
    if (sensor.is_array() && stage != Stage::time && stage != Stage::contact) return nullptr;
    switch (stage) {
        case Stage::time:
            return each_sample([rate_Hz = scene.rate_Hz](Block& block, std::size_t n) {
                block.t_s[n] = double(block.first + n) / rate_Hz;
                block.missing[n] = 0;
                block.lost[n] = 0;
                block.dropped[n] = false;
                block.arrives[n] = {1, 0};
            });
        case Stage::contact:
            return each_block([&motion = scene.motion, &sensor](Block& block) { motion.fill(block, sensor); });
        case Stage::material: return each_block([](Block& block) { block.drive = block.load; });
        case Stage::transducer:
            return each_reading(0, sensor.n(), [&sensor](double, std::size_t k, const Block& block, std::size_t n) {
                const auto& g = sensor.gain[k];
                return sensor.zero[k] + g[kFx] * block.drive[kFx][n] + g[kFy] * block.drive[kFy][n] +
                       g[kFz] * block.drive[kFz][n] + g[kMx] * block.drive[kMx][n] + g[kMy] * block.drive[kMy][n];
            });
        case Stage::converter:
        case Stage::link: break;
    }
    return nullptr;
}

// Returns the samples in which the effect of a decision is suspended.
std::vector<std::pair<std::uint64_t, std::uint64_t>> rests_of(const Choice& choice, const Decision& decision) {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> rests;
    for (std::size_t k = 0; k < choice.parts.size(); ++k)
        if (decision.rests[k]) rests.emplace_back(choice.parts[k].first_sample, choice.parts[k].end_sample);
    return rests;
}

}  // namespace

Simulation::Simulation(const Scene& scene, const std::string& effects, std::size_t block_size)
    : scene_(scene), block_size_(block_size) {
    assert(block_size >= 1 && block_size <= Block::kSize);
    lines_.reserve(scene.sensors.size());  // effects may keep references into a line
    for (const Sensor& sensor : scene.sensors) {
        Line& line = lines_.emplace_back();
        line.sensor = &sensor;
        line.extent = scene.motion.extent(sensor);
        line.choice = choose(scene, sensor, line.extent, effects);
        if (sensor.is_array())
            line.array = std::make_unique<TaxelArray>(scene, sensor, line.extent, line.choice, block_size);
        const std::size_t linear = line.choice.decisions.size();
        line.shares_N.assign(linear, 0);
        line.times_ns.assign(linear + 1, 0);
        line.block = std::make_unique<Block>();
        for (const Stage stage :
             {Stage::time, Stage::contact, Stage::material, Stage::transducer, Stage::converter, Stage::link}) {
            if (auto step = before(stage, scene, sensor)) line.steps.push_back({std::move(step), stage, linear});
            if (sensor.is_array() && stage == Stage::contact)
                line.steps.push_back(
                    {each_block([&array = *line.array](Block& block) { array.apply(block); }), stage, linear});
            for (std::size_t d = 0; d < line.choice.decisions.size(); ++d) {
                const Decision& decision = line.choice.decisions[d];
                if (!decision.on || decision.effect->stage != stage) continue;
                if (sensor.is_array() && in_array(*decision.effect) == InArray::each_taxel) continue;
                const Setting setting = scene.setting(decision.number(), sensor, line.extent);
                auto effect = decision.level == Decision::kItself ? decision.effect->make(setting)
                                                                  : decision.levels[decision.level].make(setting);
                line.steps.push_back({std::move(effect), stage, d, rests_of(line.choice, decision)});
            }
        }
    }
}

const Block& Simulation::advance(std::size_t sensor) noexcept {
    Line& line = lines_[sensor];
    Block& block = *line.block;
    block.first = line.next;
    block.n = std::size_t(std::min<std::uint64_t>(block_size_, scene_.samples - line.next));
    // Suspensions begin and end at multiples of kSize, so that each block is suspended as a whole or not at all.
    if (!line.choice.parts.empty()) block.n = std::min<std::size_t>(block.n, Block::kSize - line.next % Block::kSize);
    line.next += block.n;
    if (block.n == 0) return block;
    if (measures_shares_)
        apply_and_measure(line);
    else if (measures_times_)
        apply_and_time(line);
    else
        for (Step& step : line.steps)
            if (!rests(step, block.first)) step.effect->apply(block);
    return block;
}

// True while the effect is suspended. Blocks come in order.
bool Simulation::rests(Step& step, std::uint64_t first) noexcept {
    while (step.next_rest < step.rests.size() && step.rests[step.next_rest].second <= first) ++step.next_rest;
    return step.next_rest < step.rests.size() && step.rests[step.next_rest].first <= first;
}

// Measures the change by an effect of stages contact .. converter, as a change of channels.
void Simulation::apply_and_measure(Line& line) noexcept {
    Block& block = *line.block;
    const Sensor& sensor = *line.sensor;
    for (Step& step : line.steps) {
        if (rests(step, block.first)) continue;
        if (step.decision == line.shares_N.size()) {
            step.effect->apply(block);
            continue;
        }
        const Block was = block;
        step.effect->apply(block);
        double& max = line.shares_N[step.decision];
        for (std::size_t n = 0; n < block.n; ++n) {
            Channels change{};
            const bool load = step.stage == Stage::contact, drive = step.stage == Stage::material;
            for (std::size_t k = 0; k < sensor.n(); ++k) {
                if (!load && !drive) change[k] = block.channel[k][n] - was.channel[k][n];
                for (std::size_t axis = 0; (load || drive) && axis < kAxes; ++axis)
                    change[k] += sensor.gain[k][axis] * (load ? block.load[axis][n] - was.load[axis][n]
                                                              : block.drive[axis][n] - was.drive[axis][n]);
            }
            const double N = sensor.largest_N(change);
            if (N > max) max = N;
        }
    }
}

void Simulation::apply_and_time(Line& line) noexcept {
    std::uint64_t before_ns = now_ns();
    for (Step& step : line.steps) {
        if (rests(step, line.block->first)) continue;
        step.effect->apply(*line.block);
        const std::uint64_t after_ns = now_ns();
        line.times_ns[step.decision] += after_ns - before_ns;
        before_ns = after_ns;
    }
}

}  // namespace tactiled::sim
