// An effect: one thing that a real sensor does and an ideal one does not. One file each in effects/, listed in chain.cpp.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/sim/block.hpp"
#include "drivers/sim/motion.hpp"
#include "drivers/sim/random.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

// Its place in the chain, in this order. Each stage reads and writes its own quantities of a Block alone.
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
    double min, max;
};

struct Scene;
struct Setting;

// Changes of the channels by the effects before one, beyond the linear model of the extent's loads; N as in Bound.
struct Before {
    std::array<double, kAxes> load{};  // of contact and material: the sum of what they may have changed
    double max_N = 0;                  // of transducer and converter: the sum of their bounds
    double gain = 1;                   // the product of their gains
    struct Own {
        double max_N, rate_N_s;
    };
    std::vector<Own> own{};  // what hangs on no load

    // The largest change of any channel within some seconds.
    [[nodiscard]] double change_N(const Setting& s, double seconds) const;
};

// Input of an effect for its bound and for its construction.
struct Setting {
    const Sensor& sensor;
    const Body& body;
    const Extent& extent;          // the worst case of the scene and of the effects before this one, for this sensor
    double rate_Hz;                // of the scene
    std::uint64_t samples;         // of the scene
    Stream random;                 // its own, of this scene
    Stream sample;                 // its own, of this sample of the sensor: the same in all scenes that name its serial
    std::span<const double> p;     // parameters, in the order of its entry
    const Scene* scene = nullptr;  // for what happens to a neighbour, and for effects of time
    Before before{};
    // Of effects of time, whose bound is asked once more at the end: the bounds of all, in the order of chain(). Before that
    // it is empty, and they state only how far apart they take two samples.
    std::span<const double> stated_N{};
};

// Largest change by an effect of any channel, in N (Sensor::per_N), on any input that keeps within the extent.
struct Bound {
    double change_N = 0;  // largest difference between its output and its input: if left out, the error that this makes
    // Propagation of an error that was made before it: |f(a) - f(b)| <= gain * |a - b| + jump_N. A filter's gain is the sum
    // of its impulse response's magnitudes; a rounding jumps by a step.
    double gain = 1;
    double jump_N = 0;
    // Motion of its output, for the effects after it. A filter or a curve moves with its input, at most `gain` times as
    // much; what moves by itself (heat, noise, ridges that pass) says how far, and how fast if not at once.
    double own_N = 0, own_rate_N_s = std::numeric_limits<double>::infinity();
    // Of contact and material: by how much each component of the load may change (N, Nm); how much faster it may move; and
    // what of the movement of one force may come to another.
    std::array<double, kAxes> load{};
    double load_gain = 1, coupling = 0;
    // Of time: how much further apart two samples may be taken than they should be.
    double stretch = 1, slack_s = 0;
};

// Tells those that come after an effect what it may make of the loads (`reach`) and of the channels (`before`). setup
void pass_on(const Bound& bound, Stage stage, Extent& reach, Before& before);

// A chosen effect at work on one sensor, with its state. The simulator runs a vector of these and nothing else.
class Effect {
public:
    virtual ~Effect() = default;
    // All samples of the block, in order; blocks come in order. The result must not hang on where a block ends.
    // rt: wait-free; no allocation
    virtual void apply(Block& block) noexcept = 0;
};

// A cheaper model of an effect, in one setting.
struct Level {
    std::string_view name;  // named in `--effects exact_overlap:cubic`
    // No channel differs by more, N, from what the effect itself would make, on any input that keeps within the extent; gain
    // and jump are those of the effect.
    double error_N;
    std::function<std::unique_ptr<Effect>(const Setting&)> make;  // setup
};

struct EffectEntry {
    std::string_view name;   // as in `--effects creep,noise`
    std::string_view title;  // for a report
    std::string_view equation;
    std::string_view source;
    Stage stage;
    std::string_view cost_class;  // c0 < 5 ns, c1 5 .. 50 ns, c2 0.05 .. 1 us, c3 1 .. 50 us a sample
    double instructions;          // a sample of a sensor with all its channels, measured
    unsigned models;              // bits 1 << int(Model); it concerns no others
    std::vector<Parameter> parameters;
    Bound (*bound)(const Setting&);                          // setup
    std::unique_ptr<Effect> (*make)(const Setting&);         // setup
    std::vector<Level> (*levels)(const Setting&) = nullptr;  // setup; those that it has here, any order
    double (*delay_s)(const Setting&) = nullptr;             // setup; of a slow signal; nullptr: it delays nothing
};

// The cost of an effect for the choice, ns a sample of a sensor with all its channels: the table costs.inc, which
// `sim_bench --costs` measures in one run, so that the choice is the same on every machine. `level`: empty = the effect
// itself. Without a line in the table it is the instructions, ten a ns; for a level half of that. setup
double cost_ns(const EffectEntry& effect, std::string_view level, Model model);

inline constexpr unsigned kTable = 1u << int(Model::table), kHair = 1u << int(Model::hair),
                          kCapacitive = 1u << int(Model::capacitive), kAll = kTable | kHair | kCapacitive;

// All effects in the order in which they work: chain.cpp.
std::span<const EffectEntry* const> chain();
const EffectEntry* find_effect(std::string_view name);  // nullptr where there is none

}  // namespace tactiled::sim
