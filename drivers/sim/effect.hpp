// An effect: one behaviour of a real sensor that an ideal one does not have. Each effect has its own file in effects/
// and is listed in chain.cpp.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "config/registry.hpp"
#include "drivers/sim/block.hpp"
#include "drivers/sim/motion.hpp"
#include "drivers/sim/random.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

// The effect's place in the chain, in this order. Each stage reads and writes only its own quantities of a Block.
enum class Stage {
    time,        // t_s: the actual time of a sample
    contact,     // load, radius_m: between the body and the skin
    material,    // drive: the response of the skin to the load
    transducer,  // channel: the response of the gauges and electrodes
    converter,   // channel: the response of the electronics
    link,        // missing, lost, dropped, channel: transmission of the frame
};

inline constexpr double kByModel = std::numeric_limits<double>::quiet_NaN();

// One parameter of an effect that a scene may set, [effects.NAME] KEY = ...
struct Parameter {
    std::string_view name;  // with its unit
    std::string_view meaning;
    double usual;  // the default; kByModel = depends on the sensor's model, see the effect's file
    double min, max;
};

struct Scene;
struct Setting;

// Changes of the channels by the effects before this one, beyond the linear model of the extent's loads; N as in
// Bound.
struct Before {
    Load load{};       // contact and material: sum of the possible changes
    double max_N = 0;  // transducer and converter: sum of the bounds
    double gain = 1;   // product of the gains
    struct Own {
        double max_N, rate_N_s;
    };
    std::vector<Own> own{};  // changes that do not depend on a load

    // Returns the largest change of any channel within the given time.
    [[nodiscard]] double change_N(const Setting& s, double seconds) const;
};

// Input of an effect's bound and construction.
struct Setting {
    const Sensor& sensor;
    const Body& body;
    const Extent& extent;   // worst case of the scene and of the effects before this one, for this sensor
    double rate_Hz;         // rate of the scene
    std::uint64_t samples;  // number of samples of the scene
    Stream random;          // random numbers of this effect in this scene
    // random numbers of this effect and sensor: the same in all scenes with the sensor's serial
    Stream sample;
    std::span<const double> p;     // parameters, in the order of its entry
    const Scene* scene = nullptr;  // for effects of neighbours and of time
    Before before{};
    // For effects of time, whose bound is computed a second time at the end: the bounds of all effects, in the order
    // of chain(). In the first computation it is empty, and they state only the possible distance between two
    // samples.
    std::span<const double> stated_N{};
};

// Largest change of any channel by an effect, in N (Sensor::per_N), for any input within the extent.
struct Bound {
    double change_N = 0;  // largest difference between output and input: the error if it is left out
    // Propagation of an error of the input: |f(a) - f(b)| <= gain * |a - b| + jump_N. The gain of a filter is the sum
    // of the magnitudes of its impulse response; a rounding jumps by one step.
    double gain = 1;
    double jump_N = 0;
    // Variation of the output, for the effects after it. A filter or a curve varies with its input, at most `gain`
    // times as much. An effect that varies by itself (heat, noise, passing ridges) states the size, and the rate if
    // it is limited.
    double own_N = 0, own_rate_N_s = std::numeric_limits<double>::infinity();
    // Contact and material: possible change of each component of the load (N, Nm); factor on its rate; share of one
    // force's rate that can couple into another.
    Load load{};
    double load_gain = 1, coupling = 0;
    // Time: possible increase of the distance between two samples.
    double stretch = 1, slack_s = 0;
};

// Adds the possible influence of an effect on the loads (`reach`) and on the channels (`before`) for the effects
// after it. setup
void pass_on(const Bound& bound, Stage stage, Extent& reach, Before& before);

// A chosen effect in operation on one sensor, with its state. The simulator runs a vector of these and nothing else.
class Effect {
public:
    virtual ~Effect() = default;
    // Processes all samples of the block, in order; blocks are passed in order. The result must not depend on the
    // limits of the blocks.
    // rt: wait-free; no allocation
    virtual void apply(Block& block) noexcept = 0;
};

// Effects without a class of their own. `f` holds the parameters and, if it is mutable, the state of the effect; the
// contract of Effect::apply is that of f, too.

// Calls f(block).
template <class F>
class EachBlock final : public Effect {
public:
    explicit EachBlock(F f) : f_(std::move(f)) {}
    void apply(Block& block) noexcept override { f_(block); }

private:
    F f_;
};
template <class F>
std::unique_ptr<Effect> each_block(F f) {
    return std::make_unique<EachBlock<F>>(std::move(f));
}

// Calls f(block, n) for each sample.
template <class F>
std::unique_ptr<Effect> each_sample(F f) {
    return each_block([f = std::move(f)](Block& block) mutable {
        for (std::size_t n = 0; n < block.n; ++n) f(block, n);
    });
}

// Calls f(block, n, number) for each sample with a frame of the sensor, which is its frame `number`.
template <class F>
std::unique_ptr<Effect> each_frame(const Setting& s, F f) {
    return each_sample([every = s.sensor.every, f = std::move(f)](Block& block, std::size_t n) mutable {
        const std::uint64_t sample = block.first + n;
        if (sample % every == 0) f(block, n, sample / every);
    });
}

// Replaces each reading r of the channels k = first .. end - 1, channel after channel, by f(r, k, block, n) or f(r, k).
template <class F>
std::unique_ptr<Effect> each_reading(std::size_t first, std::size_t end, F f) {
    return each_block([first, end, f = std::move(f)](Block& block) mutable {
        for (std::size_t k = first; k < end; ++k)
            for (std::size_t n = 0; n < block.n; ++n) {
                double& r = block.channel[k][n];
                if constexpr (std::is_invocable_v<F&, double, std::size_t>)
                    r = f(r, k);
                else
                    r = f(r, k, std::as_const(block), n);
            }
    });
}
template <class F>
std::unique_ptr<Effect> each_reading(const Setting& s, F f) {
    return each_reading(0, s.sensor.n(), std::move(f));
}
// The readings of the piezo film. Without a film there are none, and find() gives a channel whose zero and per_N are 0:
// sensors that may have a film have fewer than kMaxSensorChannels channels.
template <class F>
std::unique_ptr<Effect> each_film_reading(const Setting& s, F f) {
    const std::size_t film = s.sensor.find("Vp");
    return each_reading(film, std::min(film + 1, s.sensor.n()), std::move(f));
}

// Returns f(k) of each channel k.
template <class F>
Channels per_channel(const Setting& s, F f) {
    Channels all{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) all[k] = f(k);
    return all;
}

// A cheaper model of an effect, in one setting.
struct Level {
    std::string_view name;  // name in `--effects exact_overlap:cubic`
    // Maximum difference of a channel, N, from the result of the effect itself, for any input within the extent. Gain and
    // jump are those of the effect.
    double error_N;
    std::function<std::unique_ptr<Effect>(const Setting&)> make;  // setup
};

inline constexpr unsigned kTable = 1u << int(Model::table), kHair = 1u << int(Model::hair),
                          kCapacitive = 1u << int(Model::capacitive), kAll = kTable | kHair | kCapacitive,
                          kTaxel = 1u << int(Model::taxel);

// Where an effect works if the sensor is an array of taxels. Effects of the contact work on one sensor alone and do not
// occur in arrays.
enum class InArray { by_stage, each_taxel, frame, not_at_all };

struct EffectEntry {
    std::string_view name;   // name in `--effects creep,noise`
    std::string_view title;  // for a report
    std::string_view equation;
    std::string_view source;
    Stage stage;
    double instructions;     // measured, per sample of a sensor with all its channels
    unsigned models = kAll;  // the sensors that it concerns
    std::vector<Parameter> parameters = {};
    Bound (*bound)(const Setting&);                          // setup
    std::unique_ptr<Effect> (*make)(const Setting&);         // setup
    std::vector<Level> (*levels)(const Setting&) = nullptr;  // setup; the levels available here, in any order
    // True if the output of the effect and its levels depends on no other sample, so that it may be suspended.
    bool instant = false;
    // by_stage: time: frame; material, transducer and converter: each_taxel; contact and link: not_at_all
    InArray in_array = InArray::by_stage;
    // Delay of a slow signal on a channel of the sensor; nullptr: no delay. setup
    double (*delay_s)(const Setting&, std::size_t channel) = nullptr;
    Registry<EffectEntry> in_list{this};
};

// Returns where the effect works in an array; never by_stage. setup
InArray in_array(const EffectEntry& effect);
// Returns the cost of an effect for the choice, in ns per sample of a sensor or a taxel with all its channels. It is from
// the table costs.inc, which `sim_bench --costs` measures in one run, so that the choice is the same on every machine.
// `level`: empty = the effect itself. Without a line in the table it is derived from the instructions, ten per ns;
// half of that for a level. setup
double cost_ns(const EffectEntry& effect, std::string_view level, Model model);
// Returns the class of its instructions, ten per ns: c0 below 5 ns, c1 below 50 ns, c2 below 1 us, else c3.
std::string_view cost_class(const EffectEntry& effect);

// All effects in their order of computation: chain.cpp.
std::span<const EffectEntry* const> chain();
const EffectEntry* find_effect(std::string_view name);  // nullptr if there is none

}  // namespace tactiled::sim
