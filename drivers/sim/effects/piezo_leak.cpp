// Leak of the piezo film: its charge discharges, so that it responds only to changes.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// v' = s' - v / tau, exact for a charge s that is straight between samples: v = a v + (1 - a) tau / T (s - last s).
std::unique_ptr<Effect> make(const Setting& s) {
    const std::size_t film = s.sensor.find("Vp");
    const double h = 1 / (s.rate_Hz * s.p[0]);
    return each_film_reading(s, [zero_V = s.sensor.zero[film], keep = std::exp(-h), fresh = -std::expm1(-h) / h, value = 0.0,
                                 last = 0.0](double v, std::size_t) mutable {
        const double charge = v - zero_V;
        value = keep * value + fresh * (charge - last);
        last = charge;
        return zero_V + value;
    });
}

// The lost part is the charge through a low pass: at most its largest value times 1 - exp(-T / tau).
Bound bound(const Setting& s) {
    const std::size_t film = s.sensor.find("Vp");
    if (film >= s.sensor.n()) return {};
    // the scene may continue after its motions
    const double leaks = -std::expm1(-double(s.samples) / s.rate_Hz / s.p[0]);
    Channels change{};
    for (std::size_t axis = 0; axis < kAxes; ++axis)
        change[film] += std::abs(s.sensor.gain[film][axis]) * max(s, Axis(axis)) * leaks;
    return {.change_N = s.sensor.largest_N(change), .gain = 1 + leaks};
}

const EffectEntry entry{.name = "piezo_leak",
                        .title = "leak of the piezo film",
                        .equation = "v' = s' - v / tau",
                        .source = "derived; tau below 0.1 s follows from the thesis' square wave of 1.66 Hz",
                        .stage = Stage::transducer,
                        .instructions = 19,
                        .models = kCapacitive,
                        .parameters = {{"time_s", "tau = R C, in which the voltage falls to 37 %", 0.1, 1e-5, 1e6}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
