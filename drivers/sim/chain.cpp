// The effects in the order in which they work: from the instant of a sample to its frame. This list is the data path of
// the simulator on one page; between contact and material stands the world, between material and transducer the linear
// model.
#include <array>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

// One file each in effects/, here by stage.
extern const EffectEntry bonded_layer;
extern const EffectEntry large_deflection;
extern const EffectEntry softening;
extern const EffectEntry hysteresis;
extern const EffectEntry creep;
extern const EffectEntry dome_resonance;
extern const EffectEntry contact_patch;
extern const EffectEntry exact_overlap;
extern const EffectEntry load_moment;
extern const EffectEntry gap_gain;
extern const EffectEntry tilt;
extern const EffectEntry fringe_field;
extern const EffectEntry piezo_leak;
extern const EffectEntry gain_spread;
extern const EffectEntry temperature_gain;
extern const EffectEntry crosstalk;
extern const EffectEntry bridge_nonlinearity;
extern const EffectEntry pyroelectric;
extern const EffectEntry triboelectric;
extern const EffectEntry temperature_zero;
extern const EffectEntry self_heating;
extern const EffectEntry contact_heat;
extern const EffectEntry humidity;
extern const EffectEntry mounting_curvature;
extern const EffectEntry stray_capacitance;
extern const EffectEntry zero_walk;
extern const EffectEntry noise;

namespace {

constexpr std::array kChain{
    // ---- Stage::time ----
    // ---- Stage::contact ----
    // ---- Stage::material ----
    &bonded_layer,
    &large_deflection,
    &softening,
    &hysteresis,
    &creep,
    &dome_resonance,
    // ---- Stage::transducer ----
    &contact_patch,
    &exact_overlap,
    &load_moment,
    &gap_gain,
    &tilt,
    &fringe_field,
    &piezo_leak,
    &gain_spread,
    &temperature_gain,
    &crosstalk,
    &bridge_nonlinearity,
    &pyroelectric,
    &triboelectric,
    &temperature_zero,
    &self_heating,
    &contact_heat,
    &humidity,
    &mounting_curvature,
    &stray_capacitance,
    &zero_walk,
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
