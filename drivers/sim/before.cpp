// Propagates the changes of an effect's input by the effects before it along the chain, from bound to bound.
#include <algorithm>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {
namespace {

// Adds the change of the load by an effect of the contact or the material.
void widen(Extent& extent, const Bound& bound) {
    const Extent was = extent;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
        extent.max[axis] += bound.load[axis];
        extent.span[axis] += 2 * bound.load[axis];
        extent.rate[axis] *= bound.load_gain;
        extent.jump[axis] *= bound.load_gain;
        extent.added[axis] *= bound.load_gain;
        for (std::size_t other = axis < kMx ? kFx : kMx; other < (axis < kMx ? kMx : kAxes); ++other) {
            if (other == axis) continue;
            extent.rate[axis] += bound.coupling * was.rate[other];
            extent.jump[axis] += bound.coupling * was.jump[other];
            extent.added[axis] += bound.coupling * was.added[other];
        }
        if (bound.coupling > 0) extent.back[axis] += 2 * bound.load[axis];
        if (bound.own_N > 0) extent.added[axis] += bound.load[axis];
    }
    extent.reverses |= bound.own_N > 0;
}

void add(Before& before, const Bound& bound) {
    before.max_N += bound.change_N;
    // A change that varies by itself over its whole size is counted as such; any other change varies with the input.
    const double gain = bound.own_N < bound.change_N ? bound.gain : 1;
    before.gain *= gain;
    for (auto& own : before.own) own = {own.max_N * gain, own.rate_N_s * gain};
    if (bound.own_N > 0) before.own.push_back({bound.own_N, bound.own_rate_N_s});
}

}  // namespace

void pass_on(const Bound& bound, Stage stage, Extent& reach, Before& before) {
    switch (stage) {
        case Stage::time:
            reach.stretch *= bound.stretch;
            reach.slack_s += bound.slack_s;
            break;
        case Stage::contact:
        case Stage::material:
            widen(reach, bound);
            for (std::size_t axis = 0; axis < kAxes; ++axis) before.load[axis] += bound.load[axis];
            break;
        case Stage::transducer:
        case Stage::converter:
        case Stage::link: add(before, bound);
    }
}

double Before::change_N(const Setting& s, double seconds) const {
    double sum = gain * s.sensor.channel_N(s.extent.changes(seconds));
    for (const Own& part : own) sum += std::min(2 * part.max_N, part.rate_N_s * s.extent.apart_s(seconds));
    return sum;
}

}  // namespace tactiled::sim
