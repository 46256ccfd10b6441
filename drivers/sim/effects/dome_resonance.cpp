// Resonance of a soft dome, and the propagation time of a wave through it.
#include <array>
#include <cmath>
#include <vector>

#include "drivers/sim/effects/axes.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

double resonance_Hz(const Setting& s) {
    if (!std::isnan(s.p[0])) return s.p[0];
    if (s.sensor.model == Model::capacitive) return 1100;
    // First resonance: a quarter of a wavelength in the cap.
    return std::sqrt(s.sensor.hair.young_Pa / 1000) / (4 * s.sensor.hair.height_m);
}

// Height over the speed of a shear wave.
double delay_s(const Setting& s) {
    if (!std::isnan(s.p[2])) return s.p[2];
    if (s.sensor.model == Model::capacitive)
        return s.sensor.capacitive.gap_m / std::sqrt(s.sensor.capacitive.young_Pa / (3 * 1070));
    return s.sensor.hair.height_m / std::sqrt(s.sensor.hair.young_Pa / (3 * 1000));
}

// x'' = w^2 (u(t - delay) - x) - 2 z w x', exact for a load that is straight between samples.
class DomeResonance final : public Effect {
public:
    DomeResonance(const Setting& s, const Axes& axes) : axes_(axes), step_s_(1 / s.rate_Hz) {
        const double w = 2 * std::numbers::pi * resonance_Hz(s), z = s.p[1], wd = w * std::sqrt((1 - z) * (1 + z));
        const double decay = std::exp(-z * w * step_s_), c = decay * std::cos(wd * step_s_),
                     d = decay * std::sin(wd * step_s_) / wd;
        step_ = {c + z * w * d, d, -w * w * d, c - z * w * d};
        lag_s_ = 2 * z / w;
        const double samples = delay_s(s) / step_s_;
        whole_ = std::size_t(samples);
        part_ = samples - double(whole_);
        for (auto& line : past_) line.assign(whole_ + 2, 0);
    }

    void apply(Block& block) noexcept override {
        const std::size_t length = whole_ + 2;
        for (std::size_t n = 0; n < block.n; ++n) {
            const std::size_t at = (block.first + n) % length, newer = (at + length - whole_) % length;
            const std::size_t older = (newer + length - 1) % length;
            for (std::size_t i = 0; i < axes_.n; ++i) {
                const std::size_t axis = axes_.at[i];
                past_[axis][at] = block.drive[axis][n];
                const double u = past_[axis][newer] + part_ * (past_[axis][older] - past_[axis][newer]);
                const double slope = (u - u_[axis]) / step_s_;
                // Relative to the straight line that the dome finally follows.
                const double x = x_[axis] - (u_[axis] - lag_s_ * slope), v = v_[axis] - slope;
                x_[axis] = u - lag_s_ * slope + step_[0] * x + step_[1] * v;
                v_[axis] = slope + step_[2] * x + step_[3] * v;
                u_[axis] = u;
                block.drive[axis][n] = x_[axis];
            }
        }
    }

private:
    Axes axes_;
    double step_s_, lag_s_{}, part_{};
    std::size_t whole_{};
    std::array<double, 4> step_{};
    std::array<std::vector<double>, kAxes> past_;
    Load u_{}, x_{}, v_{};
};

std::unique_ptr<Effect> on_axes(const Setting& s, const Axes& axes) { return std::make_unique<DomeResonance>(s, axes); }

// |y - u| <= integral of |h(t)| change(t + delay) dt. The impulse response h has one sign for half a period; its
// integral over half period i is (1 + q)(-q)^i, and within a half period the running integral is the step response.
Load largest_change(const Setting& s) {
    const double w = 2 * std::numbers::pi * resonance_Hz(s), z = s.p[1], root = std::sqrt((1 - z) * (1 + z));
    const double half_s = std::numbers::pi / (w * root), q = std::exp(-std::numbers::pi * z / root);
    const auto step = [&](double phase) {  // within the first half period, phase = 0 .. 1
        const double a = phase * std::numbers::pi;
        return 1 - std::exp(-z / root * a) * (std::cos(a) + z / root * std::sin(a));
    };
    constexpr int kParts = 8;
    Load moved{};
    double scale = 1;
    for (int i = 0; scale > 1e-9 && i < 2000; ++i, scale *= q)
        for (int part = 1; part <= kParts; ++part) {
            const double weight = scale * (step(double(part) / kParts) - step(double(part - 1) / kParts));
            const double seconds = (i + double(part) / kParts) * half_s + delay_s(s);
            for (std::size_t axis = 0; axis < kAxes; ++axis) moved[axis] += weight * change(s, Axis(axis), seconds);
        }
    for (std::size_t axis = 0; axis < kAxes; ++axis) moved[axis] += scale / (1 - q) * 2 * span(s, Axis(axis));
    return moved;
}

Bound bound(const Setting& s) {
    const double z = s.p[1], q = std::exp(-std::numbers::pi * z / std::sqrt((1 - z) * (1 + z)));
    return bound_of_load(s, largest_change(s), (1 + q) / (1 - q));
}

const EffectEntry entry{
    .name = "dome_resonance",
    .title = "resonance and delay of the dome",
    .equation = "x'' = w^2 (u(t - delay) - x) - 2 z w x'",
    .source = "derived: 1.1 kHz and 0.54 ms for 3 mm of Ecoflex; damping by tan delta = 2 z",
    .stage = Stage::material,
    .instructions = 290,
    .models = kHair | kCapacitive,
    .parameters = {{"resonance_Hz", "by default by the sensor's model", kByModel, 1, 1e6},
                   {"damping", "z, of the critical one", 0.25, 0.02, 0.98},
                   {"delay_s", "by default height over shear wave speed", kByModel, 0, 0.1}},
    .bound = bound,
    .make = [](const Setting& s) { return on_axes(s, {}); },
    .levels = [](const Setting& s) { return fewer_axes(s, largest_change(s), on_axes); },
    .delay_s = [](const Setting& s,
                  std::size_t) { return delay_s(s) + 2 * s.p[1] / (2 * std::numbers::pi * resonance_Hz(s)); }};

}  // namespace
}  // namespace tactiled::sim
