// Cost of each effect and of each of its levels, as measured in one run, for the choice of effects.
#include <algorithm>
#include <array>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {
namespace {

struct Cost {
    std::string_view effect, level;
    std::array<double, 4> ns;  // by Model: table, hair, capacitive, taxel; 0 = it does not concern such a sensor
};

constexpr std::array kCosts{
#include "drivers/sim/costs.inc"
    Cost{"", "", {}},
};

}  // namespace

double cost_ns(const EffectEntry& effect, std::string_view level, Model model) {
    const auto* found = std::find_if(kCosts.begin(), kCosts.end(), [&](const Cost& cost) {
        return cost.effect == effect.name && cost.level == level && cost.ns[std::size_t(model)] > 0;
    });
    if (found != kCosts.end()) return found->ns[std::size_t(model)];
    return effect.instructions / (level.empty() ? 10 : 20);
}

std::string_view cost_class(const EffectEntry& effect) {
    return effect.instructions < 50 ? "c0" : effect.instructions < 500 ? "c1" : effect.instructions < 10'000 ? "c2" : "c3";
}

}  // namespace tactiled::sim
