// The effects in their order of computation: from the instant of a sample to its frame. This list is the data path of
// the simulator on one page. The environment is between time and contact, the linear model between material and
// transducer.
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {
namespace {

constexpr std::string_view kChain[] = {
    // ---- Stage::time ----
    "clock_drift",
    "sampling_jitter",
    // ---- Stage::contact ----
    "friction_limit",
    "partial_slip",
    "stick_slip",
    "texture",
    "adhesion",
    "hertz_contact",
    "array_spread",
    "misalignment",
    // ---- Stage::material ----
    "bonded_layer",
    "large_deflection",
    "softening",
    "hysteresis",
    "creep",
    "dome_resonance",
    // ---- Stage::transducer ----
    "contact_patch",
    "exact_overlap",
    "load_moment",
    "gap_gain",
    "tilt",
    "fringe_field",
    "piezo_leak",
    "gain_spread",
    "temperature_gain",
    "crosstalk",
    "bridge_nonlinearity",
    "pyroelectric",
    "triboelectric",
    "temperature_zero",
    "temperature_gradient",
    "self_heating",
    "contact_heat",
    "humidity",
    "mounting_curvature",
    "stray_capacitance",
    "zero_walk",
    "cap_weight",
    // ---- Stage::converter ----
    "lead_wires",
    "excitation_drift",
    "piezo_amplifier",
    "anti_alias",
    "converter_window",
    "channel_skew",
    // A disturbance is specified in units of the reading, so it is added after the filters.
    "johnson_noise",
    "flicker_noise",
    "noise",
    "mains_hum",
    "spikes",
    "converter_nonlinearity",
    "saturation",
    "quantisation",
    // ---- Stage::link ----
    "dead_channel",
    "bit_errors",
    "cut_frames",
    "late_frames",
    "repeated_frames",
    "overtaken_frames",
    "lost_frames",
};

// Throws where this list and the entries of effects/ differ, which is an error of the program.
std::vector<const EffectEntry*> in_order() {
    std::vector<const EffectEntry*> chain;
    for (const std::string_view name : kChain) {
        chain.push_back(find_effect(name));
        if (chain.back() == nullptr) throw std::logic_error(fmt::format("chain.cpp: no file defines effect \"{}\"", name));
    }
    for (const EffectEntry* entry : Registry<EffectEntry>::all())
        if (std::count(chain.begin(), chain.end(), entry) != 1)
            throw std::logic_error(fmt::format("chain.cpp: effect \"{}\" has to be listed once", entry->name));
    return chain;
}

}  // namespace

std::span<const EffectEntry* const> chain() {
    static const std::vector<const EffectEntry*> chain = in_order();
    return chain;
}

InArray in_array(const EffectEntry& effect) {
    if (effect.in_array != InArray::by_stage) return effect.in_array;
    if (effect.stage == Stage::time) return InArray::frame;
    return effect.stage == Stage::contact || effect.stage == Stage::link ? InArray::not_at_all : InArray::each_taxel;
}

const EffectEntry* find_effect(std::string_view name) { return Registry<EffectEntry>::find(name); }

}  // namespace tactiled::sim
