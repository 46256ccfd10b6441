// An effect: one thing that a real sensor does and an ideal one does not. One file each in effects/, listed in chain.cpp.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/sim/block.hpp"
#include "drivers/sim/motion.hpp"
#include "drivers/sim/random.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

// Where in the chain it works, in this order. Each stage reads and writes its own quantities of a Block alone.
enum class Stage {
    time,        // t_s: when a sample is really taken
    contact,     // load, radius_m: between the body and the skin
    material,    // drive: what the skin makes of the load
    transducer,  // channel: what the gauges and electrodes make of that
    converter,   // channel: what the electronics make of that
    link,        // missing, lost, dropped, channel: what becomes of the frame
};

// One number of an effect that a scene may set, [effects.NAME] KEY = ...
struct Parameter {
    std::string_view name;  // with its unit
    std::string_view meaning;
    double usual;  // the default; NaN = hangs on the sensor's model, see the effect's file
    double least, most;
};

struct Scene;

// What an effect is told when its bound is asked and when it is made.
struct Setting {
    const Sensor& sensor;
    const Body& body;
    const Extent& extent;          // what the scene states for this sensor, worst case
    double rate_Hz;                // of the scene
    std::uint64_t samples;         // of the scene
    Stream random;                 // its own, of this scene
    Stream sample;                 // its own, of this sample of the sensor: the same in all scenes that name its serial
    std::span<const double> p;     // parameters, in the order of its entry
    const Scene* scene = nullptr;  // of the others and of a neighbour; nullptr: none are known
};

// What an effect can do to any channel, in N (Sensor::per_N), on any input that keeps within the extent.
struct Bound {
    double change_N = 0;  // largest difference between its output and its input: if left out, the error that this makes
    // How it hands on an error that was made before it: |f(a) - f(b)| <= gain * |a - b| + jump_N. A filter's gain is the sum
    // of its impulse response's magnitudes; a rounding jumps by a step.
    double gain = 1;
    double jump_N = 0;
};

// A chosen effect at work on one sensor, with its state. The simulator runs a vector of these and nothing else.
class Effect {
public:
    virtual ~Effect() = default;
    // All samples of the block, in order; blocks come in order. The result must not hang on where a block ends.
    // rt: wait-free; no allocation
    virtual void apply(Block& block) noexcept = 0;
};

struct EffectEntry {
    std::string_view name;   // as in `--effects creep,noise`
    std::string_view title;  // for a report
    std::string_view equation;
    std::string_view source;
    Stage stage;
    std::string_view cost_class;  // c0 < 5 ns, c1 5 .. 50 ns, c2 0.05 .. 1 us, c3 1 .. 50 us a sample
    double instructions;          // a sample of a sensor with all its channels, measured: what the choice counts as its cost
    unsigned models;              // bits 1 << int(Model); it concerns no others
    std::vector<Parameter> parameters;
    Bound (*bound)(const Setting&);                   // setup
    std::unique_ptr<Effect> (*make)(const Setting&);  // setup
};

// What stands before an effect may make its input larger than the extent says, by at most this factor.
inline constexpr double kMargin = 1.25;

inline constexpr unsigned kTable = 1u << int(Model::table), kHair = 1u << int(Model::hair),
                          kCapacitive = 1u << int(Model::capacitive), kAll = kTable | kHair | kCapacitive;

// All effects in the order in which they work: chain.cpp.
std::span<const EffectEntry* const> chain();
const EffectEntry* find_effect(std::string_view name);  // nullptr where there is none

}  // namespace tactiled::sim
