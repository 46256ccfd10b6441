// Spikes: interference and discharges, which are rare, steep and short.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

double amplitude_N(const Setting& s) { return std::isnan(s.p[2]) ? 0.05 * s.sensor.full_scale_N : s.p[2]; }

// Sum of the spikes at each sample, relative to the largest amplitude of one. The events are a Poisson process, each
// of a size up to 1 and of either sign; the sum is limited to 1.
class Train {
public:
    explicit Train(const Setting& s)
        : random_(s.random),
          mean_s_(1 / std::max(s.p[0], 1e-30)),
          rate_Hz_(s.rate_Hz),
          time_s_(s.p[1]),
          keep_(std::exp(-1 / (s.p[1] * s.rate_Hz))) {
        draw();
    }
    double at(std::uint64_t sample) noexcept {
        const double now_s = double(sample) / rate_Hz_;
        value_ *= keep_;
        for (; next_s_ <= now_s; draw())
            value_ += (2 * random_.uniform(event_, 1) - 1) * std::exp((next_s_ - now_s) / time_s_);
        value_ = std::clamp(value_, -1.0, 1.0);
        return value_;
    }
    // First sample that the next event affects.
    [[nodiscard]] double next_sample() const { return std::ceil(next_s_ * rate_Hz_); }
    void rest(double samples) { value_ *= std::exp(-samples / (time_s_ * rate_Hz_)); }

private:
    void draw() noexcept { next_s_ += std::max(-std::log1p(-random_.uniform(++event_)) * mean_s_, 1e-6); }

    Stream random_;
    double mean_s_, rate_Hz_, time_s_, keep_;
    std::uint64_t event_ = 0;
    double next_s_ = 0, value_ = 0;
};

std::unique_ptr<Effect> make(const Setting& s) {
    const Channels amplitude = per_channel(s, [&](std::size_t k) { return amplitude_N(s) * s.sensor.per_N[k]; });
    return each_sample([channels = s.sensor.n(), train = Train(s), amplitude](Block& block, std::size_t n) mutable {
        const double value = train.at(block.first + n);
        for (std::size_t k = 0; k < channels; ++k) block.channel[k][n] += amplitude[k] * value;
    });
}

// The largest sum in the scene; beyond 10,000 spikes, the largest possible one.
Bound bound(const Setting& s) {
    Train train(s);
    double max = 0, last = 0;
    for (int i = 0; train.next_sample() < double(s.samples); ++i) {
        if (i == 10000) {
            max = 1;
            break;
        }
        const double sample = i == 0 ? train.next_sample() : std::max(train.next_sample(), last + 1);
        train.rest(sample - last - 1);
        max = std::max(max, std::abs(train.at(std::uint64_t(sample))));
        last = sample;
    }
    const double max_N = max * 1.000001 * amplitude_N(s);
    return bound_of_own(s, per_channel(s, [&](std::size_t k) { return max_N * s.sensor.per_N[k]; }));
}

const EffectEntry entry{.name = "spikes",
                        .title = "spikes of interference",
                        .equation = "r = r + sum of A_i exp(-(t - t_i) / tau), t_i a Poisson process",
                        .source = "derived",
                        .stage = Stage::converter,
                        .instructions = 130,
                        .parameters = {{"rate_1_s", "spikes a second", 0.01, 0, 1000},
                                       {"time_s", "in which one goes down to a third", 2e-3, 1e-6, 10},
                                       {"amplitude_N", "of the largest; by default 5 % of full scale", kByModel, 0, 1e4}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
