// The effects in their order of computation: from the instant of a sample to its frame. This list is the data path of
// the simulator on one page. The environment is between time and contact, the linear model between material and
// transducer.
#include <array>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

// Each effect has its own file in effects/; listed here by stage.
extern const EffectEntry adhesion;
extern const EffectEntry anti_alias;
extern const EffectEntry array_spread;
extern const EffectEntry bit_errors;
extern const EffectEntry bonded_layer;
extern const EffectEntry bridge_nonlinearity;
extern const EffectEntry cap_weight;
extern const EffectEntry channel_skew;
extern const EffectEntry clock_drift;
extern const EffectEntry contact_heat;
extern const EffectEntry contact_patch;
extern const EffectEntry converter_nonlinearity;
extern const EffectEntry converter_window;
extern const EffectEntry creep;
extern const EffectEntry crosstalk;
extern const EffectEntry cut_frames;
extern const EffectEntry dead_channel;
extern const EffectEntry dome_resonance;
extern const EffectEntry exact_overlap;
extern const EffectEntry excitation_drift;
extern const EffectEntry flicker_noise;
extern const EffectEntry friction_limit;
extern const EffectEntry fringe_field;
extern const EffectEntry gain_spread;
extern const EffectEntry gap_gain;
extern const EffectEntry hertz_contact;
extern const EffectEntry humidity;
extern const EffectEntry hysteresis;
extern const EffectEntry johnson_noise;
extern const EffectEntry large_deflection;
extern const EffectEntry late_frames;
extern const EffectEntry lead_wires;
extern const EffectEntry load_moment;
extern const EffectEntry lost_frames;
extern const EffectEntry mains_hum;
extern const EffectEntry misalignment;
extern const EffectEntry mounting_curvature;
extern const EffectEntry noise;
extern const EffectEntry overtaken_frames;
extern const EffectEntry partial_slip;
extern const EffectEntry piezo_amplifier;
extern const EffectEntry piezo_leak;
extern const EffectEntry pyroelectric;
extern const EffectEntry quantisation;
extern const EffectEntry repeated_frames;
extern const EffectEntry sampling_jitter;
extern const EffectEntry saturation;
extern const EffectEntry self_heating;
extern const EffectEntry softening;
extern const EffectEntry spikes;
extern const EffectEntry stick_slip;
extern const EffectEntry stray_capacitance;
extern const EffectEntry temperature_gain;
extern const EffectEntry temperature_zero;
extern const EffectEntry texture;
extern const EffectEntry tilt;
extern const EffectEntry triboelectric;
extern const EffectEntry zero_walk;

namespace {

constexpr std::array kChain{
    // ---- Stage::time ----
    &clock_drift,
    &sampling_jitter,
    // ---- Stage::contact ----
    &friction_limit,
    &partial_slip,
    &stick_slip,
    &texture,
    &adhesion,
    &hertz_contact,
    &array_spread,
    &misalignment,
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
    &cap_weight,
    // ---- Stage::converter ----
    &lead_wires,
    &excitation_drift,
    &piezo_amplifier,
    &anti_alias,
    &converter_window,
    &channel_skew,
    // A disturbance is specified in units of the reading, so it is added after the filters.
    &johnson_noise,
    &flicker_noise,
    &noise,
    &mains_hum,
    &spikes,
    &converter_nonlinearity,
    &saturation,
    &quantisation,
    // ---- Stage::link ----
    &dead_channel,
    &bit_errors,
    &cut_frames,
    &late_frames,
    &repeated_frames,
    &overtaken_frames,
    &lost_frames,
};

}  // namespace

std::span<const EffectEntry* const> chain() { return kChain; }

const EffectEntry* find_effect(std::string_view name) {
    for (const EffectEntry* effect : kChain)
        if (effect->name == name) return effect;
    return nullptr;
}

}  // namespace tactiled::sim
