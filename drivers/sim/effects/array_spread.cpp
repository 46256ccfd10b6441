// Spread in an array: taxels under one skin measure a part of their neighbours' load.
#include <cmath>
#include <vector>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

// Returns the sensors to the left, to the right, before and behind, if the array has them.
std::vector<Sensor> neighbours(const Sensor& sensor) {
    std::vector<Sensor> result;
    if (sensor.half_width_m <= 0) return result;
    const auto add = [&](bool exists, double columns, double rows) {
        if (!exists) return;
        result.push_back(sensor);
        result.back().x_m += 2 * sensor.half_width_m * columns;
        result.back().y_m += 2 * sensor.half_width_m * rows;
    };
    add(sensor.array_column > 0, -1, 0);
    add(sensor.array_column + 1 < sensor.columns, 1, 0);
    add(sensor.array_row > 0, 0, -1);
    add(sensor.array_row + 1 < sensor.rows, 0, 1);
    return result;
}

// load + k sum of (the neighbour's load - load): a load that one taxel loses goes to another. The spread part is
// uniform and has no moment.
class ArraySpread final : public Effect {
public:
    explicit ArraySpread(const Setting& s)
        : motion_(s.scene == nullptr ? nullptr : &s.scene->motion), neighbours_(neighbours(s.sensor)), share_(s.p[0]) {}
    void apply(Block& block) noexcept override {
        if (motion_ == nullptr || neighbours_.empty()) return;
        const double kept = 1 - share_ * double(neighbours_.size());
        for (std::size_t axis = 0; axis < kAxes; ++axis)
            for (std::size_t n = 0; n < block.n; ++n) block.load[axis][n] *= kept;
        there_->first = block.first;
        there_->n = block.n;
        there_->t_s = block.t_s;
        for (const Sensor& neighbour : neighbours_) {
            motion_->fill(*there_, neighbour);
            for (std::size_t axis = kFx; axis <= kFz; ++axis)
                for (std::size_t n = 0; n < block.n; ++n) block.load[axis][n] += share_ * there_->load[axis][n];
        }
    }

private:
    const Motion* motion_;
    std::vector<Sensor> neighbours_;
    double share_;
    std::unique_ptr<Block> there_ = std::make_unique<Block>();
};

// A taxel loses at most k n of its own load, or receives k times the load of all neighbours together, at most the
// whole. Under a body that covers all taxels alike, only the changes of its own load by other effects remain.
Bound bound(const Setting& s) {
    const double count = double(neighbours(s.sensor).size());
    if (count == 0 || s.scene == nullptr) return {};
    const auto& observed_load = covers_array(s.body, s.sensor) ? s.before.load : s.extent.max;
    Load change{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) change[axis] = s.p[0] * count * observed_load[axis];
    const double change_N = s.sensor.channel_N(change);
    return {.change_N = change_N + kLastBits_N, .own_N = change_N, .load = change};
}

const EffectEntry entry{
    .name = "array_spread",
    .title = "spread to neighbours in an array",
    .equation = "F = F + k sum over neighbours of (F_n - F)",
    .source = "derived: point spread of a common skin",
    .stage = Stage::contact,
    .instructions = 1000,
    .parameters = {{"share", "that each of up to four neighbours gets", 0.05, 0, 0.25}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<ArraySpread>(s); }};

}  // namespace
}  // namespace tactiled::sim
