// Creep: under a constant load an elastomer continues to yield, and it recovers as slowly.
#include <array>
#include <cmath>

#include "drivers/sim/effects/axes.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// A Kelvin chain on each axis: y = u + sum of g_i x_i, x_i' = (u - x_i) / tau_i, exact for a load that is straight between
// samples.
class Creep final : public Effect {
public:
    explicit Creep(const Setting& s, const Axes& axes = {}) : axes_(axes), amount_{s.p[0] / 2, s.p[0] / 2} {
        const std::array<double, kTimes> tau{s.p[1], 10 * s.p[1]};
        for (std::size_t i = 0; i < kTimes; ++i) {
            const double h = 1 / s.rate_Hz / tau[i];
            keep_[i] = std::exp(-h);
            now_[i] = 1 + std::expm1(-h) / h;  // weight of the newest load
            before_[i] = -std::expm1(-h) - now_[i];
        }
    }

    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < axes_.n; ++k) {
            const std::size_t axis = axes_.at[k];
            for (std::size_t n = 0; n < block.n; ++n) {
                const double u = block.drive[axis][n];
                double y = u;
                for (std::size_t i = 0; i < kTimes; ++i) {
                    x_[i][axis] = keep_[i] * x_[i][axis] + before_[i] * last_[axis] + now_[i] * u;
                    y += amount_[i] * x_[i][axis];
                }
                last_[axis] = u;
                block.drive[axis][n] = y;
            }
        }
    }

private:
    static constexpr std::size_t kTimes = 2;
    Axes axes_;
    std::array<double, kTimes> amount_, keep_{}, now_{}, before_{};
    std::array<std::array<double, kAxes>, kTimes> x_{};
    std::array<double, kAxes> last_{};
};

// |x_i| after T is at most the largest load times 1 - exp(-T / tau_i). T is the length of the scene, which may
// continue after its motions.
std::array<double, kAxes> largest_change(const Setting& s) {
    const double amount = s.p[0] / 2, T = double(s.samples) / s.rate_Hz;
    const double part = amount * (-std::expm1(-T / s.p[1]) - std::expm1(-T / (10 * s.p[1])));
    std::array<double, kAxes> change{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) change[axis] = part * max(s, Axis(axis));
    return change;
}

Bound bound(const Setting& s) {
    const auto change = largest_change(s);
    return {.change_N = s.sensor.channel_N(change), .gain = 1 + s.p[0], .load = change, .load_gain = 1 + s.p[0]};
}

const EffectEntry entry{.name = "creep",
                        .title = "creep and relaxation",
                        .equation = "y = u + sum g_i x_i, x_i' = (u - x_i) / tau_i",
                        .source = "Kelvin chain; load cells creep by 0.2 to 0.8 % in 200 to 400 s, elastomers by 1 to 10 %",
                        .stage = Stage::material,
                        .cost_class = "c1",
                        .instructions = 160,
                        .models = kAll,
                        .parameters = {{"amount", "of the load, after a long time", 0.02, 0, 1},
                                       {"time_s", "of the faster half; the slower takes ten times as long", 5, 1e-3, 1e6}},
                        .bound = bound,
                        .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<Creep>(s); },
                        .levels = [](const Setting& s) { return fewer_axes<Creep>(s, largest_change(s)); }};

}  // namespace
}  // namespace tactiled::sim
