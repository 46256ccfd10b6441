// Softening (Mullins): below the largest load so far an elastomer yields more than at its first loading.
#include <array>
#include <cmath>

#include "drivers/sim/effects/axes.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

class Softening final : public Effect {
public:
    explicit Softening(const Setting& s, const Axes& axes = {}) : axes_(axes), amount_(s.p[0]) {}
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < axes_.n; ++k) {
            const std::size_t axis = axes_.at[k];
            for (std::size_t n = 0; n < block.n; ++n) {
                const double u = block.drive[axis][n];
                largest_[axis] = std::max(largest_[axis], std::abs(u));
                if (largest_[axis] > 0) block.drive[axis][n] = u * (1 + amount_ * (1 - std::abs(u) / largest_[axis]));
            }
        }
    }

private:
    Axes axes_;
    double amount_;
    std::array<double, kAxes> largest_{};
};

// |u| (1 - |u| / m) is at most m / 4, and m - |u|. Its slope is at most 1 by u and at most 1 by m.
std::array<double, kAxes> largest_change(const Setting& s) {
    std::array<double, kAxes> change{};
    for (std::size_t axis = 0; axis < kAxes; ++axis)
        change[axis] = s.p[0] * std::min(max(s, Axis(axis)) / 4, comes_back(s, Axis(axis)));
    return change;
}

Bound bound(const Setting& s) {
    const auto change = largest_change(s);
    const double gain = 1 + 2 * s.p[0];
    return {.change_N = s.sensor.channel_N(change), .gain = gain, .load = change, .load_gain = gain};
}

const EffectEntry entry{.name = "softening",
                        .title = "softening by the first cycles",
                        .equation = "y = u (1 + d (1 - |u| / max |u| so far))",
                        .source = "Mullins 1969; Ogden, Roxburgh 1999, linear in the load",
                        .stage = Stage::material,
                        .cost_class = "c1",
                        .instructions = 90,
                        .models = kHair | kCapacitive,
                        .parameters = {{"amount", "d, of the load", 0.05, 0, 1}},
                        .bound = bound,
                        .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<Softening>(s); },
                        .levels = [](const Setting& s) { return fewer_axes<Softening>(s, largest_change(s)); }};

}  // namespace
}  // namespace tactiled::sim
