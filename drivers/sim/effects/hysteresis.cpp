// Hysteresis: during unloading a skin reads more than during loading at the same load, at any speed.
#include <array>
#include <cmath>

#include "drivers/sim/effects/axes.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

constexpr std::size_t kPlayOperators = 6;

// The largest difference between loading and unloading over a cycle from 0 to full scale and back, relative to full
// scale.
double width(const Setting& s) {
    if (!std::isnan(s.p[0])) return s.p[0];
    return s.sensor.model == Model::table ? 0.0484 : 0.02;
}

// Play operator of half width r: the output follows u only beyond a dead band of 2 r (backlash).
double play(double p, double u, double r) { return std::clamp(p, u - r, u + r); }
double from_rest(double u, double r) { return u - std::clamp(u, -r, r); }

// Half widths relative to full scale, chosen so that an unloading from full scale passes the last one at 0.
constexpr double half_width(std::size_t i) { return double(i + 1) / double(2 * kPlayOperators); }

// Weight of each play operator that gives a loop of width 1.
double unit_weight() {
    double widest = 0;
    for (int step = 0; step <= 1000; ++step) {
        const double u = step * 1e-3;
        double sum = 0;
        for (std::size_t i = 0; i < kPlayOperators; ++i)
            sum += play(from_rest(1, half_width(i)), u, half_width(i)) - from_rest(u, half_width(i));
        widest = std::max(widest, sum);
    }
    return 1 / widest;
}

// Full scale of an axis; for a moment, the force at half the radius.
double full_scale(const Sensor& sensor, std::size_t axis) {
    return sensor.full_scale_N * (axis < kMx ? 1 : half_size_m(sensor) / 2);
}

// y = u + w sum of (P_i[u] - P_i[u from rest]): 0 as long as the load only rises, as in a calibration by rising
// loads.
std::unique_ptr<Effect> on_axes(const Setting& s, const Axes& axes) {
    std::array<std::array<double, kPlayOperators>, kAxes> r{};
    for (std::size_t axis = 0; axis < kAxes; ++axis)
        for (std::size_t i = 0; i < kPlayOperators; ++i) r[axis][i] = half_width(i) * full_scale(s.sensor, axis);
    return each_drive(axes, [weight = width(s) * unit_weight(), r, p = decltype(r){}](double u, std::size_t axis) mutable {
        double sum = 0;
        for (std::size_t i = 0; i < kPlayOperators; ++i) {
            p[axis][i] = play(p[axis][i], u, r[axis][i]);
            sum += p[axis][i] - from_rest(u, r[axis][i]);
        }
        return u + weight * sum;
    });
}

// Both P are within r of u, and within the range of u less r: they differ by at most min(2 r, span - r), and by no
// more than the largest decrease of u. Both follow u with a slope of at most 1.
Load largest_change(const Setting& s) {
    const double weight = width(s) * unit_weight();
    Load change{};
    for (std::size_t axis = 0; axis < kAxes; ++axis)
        for (std::size_t i = 0; i < kPlayOperators; ++i) {
            const double r = half_width(i) * full_scale(s.sensor, axis), back = comes_back(s, Axis(axis));
            change[axis] += weight * std::clamp(std::min(span(s, Axis(axis)) - r, back), 0.0, 2 * r);
        }
    return change;
}

Bound bound(const Setting& s) {
    return bound_of_load(s, largest_change(s), 1 + 2 * width(s) * unit_weight() * double(kPlayOperators));
}

const EffectEntry entry{
    .name = "hysteresis",
    .title = "hysteresis",
    .equation = "y = u + w sum (P_i[u] - P_i[u from rest]), |P_i - u| <= r_i",
    .source = "Prandtl, Ishlinskii; table 4.84 %: Lee, thesis",
    .stage = Stage::material,
    .instructions = 1100,
    .models = kAll | kTaxel,
    .parameters = {{"width", "of full scale, the loop from 0 to full scale; by default by the sensor's model", kByModel, 0,
                    0.5}},
    .bound = bound,
    .make = [](const Setting& s) { return on_axes(s, {}); },
    .levels = [](const Setting& s) { return fewer_axes(s, largest_change(s), on_axes); }};

}  // namespace
}  // namespace tactiled::sim
