// Exact overlap: the area that a round electrode shares with a sector is not linear in its shift.
#include <cmath>

#include "drivers/sim/effects/pad.hpp"
#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/surrogate.hpp"

namespace tactiled::sim {
namespace {

// Capacitance change by the area beyond the linear model, pF.
double more_pF(const Sensor& sensor, const Pad& pad, std::size_t i, double fx, double fy) {
    const auto& gain = sensor.gain[pad.channel[i]];
    return pad.active_pF[i] * pad.overlap_change(i, pad.shift_per_N_m * fx, pad.shift_per_N_m * fy) -
           (gain[kFx] * fx + gain[kFy] * fy);
}

std::unique_ptr<Effect> make(const Setting& s) {
    return each_block([&sensor = s.sensor, pad = Pad(s.sensor)](Block& block) {
        for (std::size_t i = 0; i < pad.n; ++i)
            for (std::size_t n = 0; n < block.n; ++n)
                block.channel[pad.channel[i]][n] += more_pF(sensor, pad, i, block.drive[kFx][n], block.drive[kFy][n]);
    });
}

// The largest value over a grid of shears that includes the corners of the extent, and the steepest slope on it, plus
// a tenth for values in between: the function is nearly quadratic.
Bound bound(const Setting& s) {
    const Pad pad(s.sensor);
    const double X = max(s, kFx), Y = max(s, kFy);
    if (X + Y == 0) return {};
    constexpr int kSteps = 12;
    Channels change{}, of_error{};
    for (std::size_t i = 0; i < pad.n; ++i) {
        double steepest_x = 0, steepest_y = 0;
        for (int a = -kSteps; a <= kSteps; ++a) {
            double before_x = 0, before_y = 0;
            for (int b = -kSteps; b <= kSteps; ++b) {
                const double along_x = more_pF(s.sensor, pad, i, X * b / kSteps, Y * a / kSteps);
                const double along_y = more_pF(s.sensor, pad, i, X * a / kSteps, Y * b / kSteps);
                change[pad.channel[i]] = std::max(change[pad.channel[i]], 1.1 * std::abs(along_x));
                if (b > -kSteps && X > 0) steepest_x = std::max(steepest_x, std::abs(along_x - before_x) * kSteps / X);
                if (b > -kSteps && Y > 0) steepest_y = std::max(steepest_y, std::abs(along_y - before_y) * kSteps / Y);
                before_x = along_x;
                before_y = along_y;
            }
        }
        of_error[pad.channel[i]] =
            1.1 * (steepest_x * load_of_error(s.sensor, kFx) + steepest_y * load_of_error(s.sensor, kFy));
    }
    return {.change_N = s.sensor.largest_N(change), .gain = 1 + s.sensor.largest_N(of_error)};
}

// The same change as a cubic polynomial of the shear, one per electrode.
std::unique_ptr<Effect> make_cubic(const Setting& s, const std::array<Cubic, Pad::kMax>& cubic) {
    return each_block([pad = Pad(s.sensor), cubic](Block& block) {
        for (std::size_t i = 0; i < pad.n; ++i) {
            const Cubic more_pF = cubic[i];
            Block::Row& channel = block.channel[pad.channel[i]];
            for (std::size_t n = 0; n < block.n; ++n) channel[n] += more_pF(block.drive[kFx][n], block.drive[kFy][n]);
        }
    });
}

std::vector<Level> levels(const Setting& s) {
    const Pad pad(s.sensor);
    std::array<Cubic, Pad::kMax> cubic;
    Channels error{};
    for (std::size_t i = 0; i < pad.n; ++i) {
        cubic[i] = Cubic([&](double fx, double fy) { return more_pF(s.sensor, pad, i, fx, fy); }, kBeyond * max(s, kFx),
                         kBeyond * max(s, kFy));
        error[pad.channel[i]] = cubic[i].error();
    }
    return {{"cubic", s.sensor.largest_N(error), [cubic](const Setting& in) { return make_cubic(in, cubic); }}};
}

const EffectEntry entry{
    .name = "exact_overlap",
    .title = "exact overlap of the electrodes",
    .equation = "A = 1/2 integral over the sector of clip(rho)^2 - inner^2, rho = d cos t + (R^2 - d^2 sin^2 t)^(1/2)",
    .source = "derived",
    .stage = Stage::transducer,
    .instructions = 6400,
    .models = kCapacitive,
    .bound = bound,
    .make = make,
    .levels = levels,
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
