// Leak of the piezo film: its charge discharges, so that it responds only to changes.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// v' = s' - v / tau, exact for a charge s that is straight between samples: v = a v + (1 - a) tau / T (s - last s).
class PiezoLeak final : public Effect {
public:
    explicit PiezoLeak(const Setting& s) : film_(s.sensor.find("Vp")), has_film_(film_ < s.sensor.n()) {
        if (!has_film_) return;
        zero_ = s.sensor.zero[film_];
        const double h = 1 / (s.rate_Hz * s.p[0]);
        keep_ = std::exp(-h);
        new_ = -std::expm1(-h) / h;
    }
    void apply(Block& block) noexcept override {
        if (!has_film_) return;
        for (std::size_t n = 0; n < block.n; ++n) {
            const double charge = block.channel[film_][n] - zero_;
            value_ = keep_ * value_ + new_ * (charge - last_);
            last_ = charge;
            block.channel[film_][n] = zero_ + value_;
        }
    }

private:
    std::size_t film_;
    bool has_film_;
    double zero_ = 0, keep_ = 0, new_ = 0, value_ = 0, last_ = 0;
};

// The lost part is the charge through a low pass: at most its largest value times 1 - exp(-T / tau).
Bound bound(const Setting& s) {
    const std::size_t film = s.sensor.find("Vp");
    if (film >= s.sensor.n()) return {};
    // the scene may continue after its motions
    const double leaks = -std::expm1(-double(s.samples) / s.rate_Hz / s.p[0]);
    std::array<double, kMaxSensorChannels> change{};
    for (std::size_t axis = 0; axis < kAxes; ++axis)
        change[film] += std::abs(s.sensor.gain[film][axis]) * max(s, Axis(axis)) * leaks;
    return {.change_N = s.sensor.largest_N(change), .gain = 1 + leaks};
}

const EffectEntry entry{.name = "piezo_leak",
                        .title = "leak of the piezo film",
                        .equation = "v' = s' - v / tau",
                        .source = "derived; tau below 0.1 s follows from the thesis' square wave of 1.66 Hz",
                        .stage = Stage::transducer,
                        .cost_class = "c1",
                        .instructions = 19,
                        .models = kCapacitive,
                        .parameters = {{"time_s", "tau = R C, in which the voltage falls to 37 %", 0.1, 1e-5, 1e6}},
                        .bound = bound,
                        .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<PiezoLeak>(s); }};

}  // namespace
}  // namespace tactiled::sim
