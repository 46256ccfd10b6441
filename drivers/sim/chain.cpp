// The effects in the order in which they work: from the instant of a sample to its frame. This list is the data path of
// the simulator on one page; between contact and material stands the world, between material and transducer the linear
// model.
#include <array>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

// One file each in effects/, here by stage.
extern const EffectEntry creep;
extern const EffectEntry noise;

namespace {

constexpr std::array kChain{
    // ---- Stage::time ----
    // ---- Stage::contact ----
    // ---- Stage::material ----
    &creep,
    // ---- Stage::transducer ----
    // ---- Stage::converter ----
    &noise,
    // ---- Stage::link ----
};

}  // namespace

std::span<const EffectEntry* const> chain() { return kChain; }

const EffectEntry* find_effect(std::string_view name) {
    for (const EffectEntry* effect : kChain)
        if (effect->name == name) return effect;
    return nullptr;
}

}  // namespace tactiled::sim
