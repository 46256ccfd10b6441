// Walk of the zero: a random walk.
#include <array>
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// Levy's construction of a Brownian path: the end, then the middle of each half, of each quarter ... The numbers are
// bounded, so that the path is bounded, and each point depends only on its place. Linear between knots of 64 samples.
class Walk {
public:
    static constexpr std::uint64_t kEvery = 64;
    explicit Walk(const Setting& s) : random_(s.random) {
        while ((kEvery << levels_) < s.samples + 1 && levels_ < 40) ++levels_;
        scale_ =
            (std::isnan(s.p[0]) ? 1e-5 * s.sensor.full_scale_N : s.p[0]) * std::sqrt(double(kEvery << levels_) / s.rate_Hz);
    }

    // Returns N at knot i <= 2^levels, from the first `levels` of them.
    [[nodiscard]] double at(std::uint64_t i, std::size_t channel, unsigned levels) const noexcept {
        double sum = random_.noise(0, channel) * std::ldexp(double(i), -int(levels_)), height = 0.5;
        for (unsigned level = 0; level < levels; ++level, height *= std::numbers::sqrt2 / 2) {
            const unsigned shift = levels_ - level;
            const double u = std::ldexp(double(i & ((1ull << shift) - 1)), 1 - int(shift));  // 0 .. 2 over an interval
            if (u > 0) sum += height * std::min(u, 2 - u) * random_.noise((1ull << level) + (i >> shift), channel);
        }
        return scale_ * sum;
    }

    // Upper limit of |at| up to that sample: the first eight levels exactly, plus the largest contribution of the
    // others.
    [[nodiscard]] double max(std::uint64_t samples, std::size_t channel) const {
        const unsigned looked_at = std::min(levels_, 8u);
        const std::uint64_t step = 1ull << (levels_ - looked_at);
        double max = 0;
        for (std::uint64_t i = 0; i < samples / kEvery + 1 + step && i <= 1ull << levels_; i += step)
            max = std::max(max, std::abs(at(i, channel, looked_at)));
        double beyond = 0;
        for (unsigned level = looked_at; level < levels_; ++level) beyond += std::exp2(-0.5 * level - 1);
        return max + scale_ * kMaxNoise * beyond;
    }
    [[nodiscard]] double at(std::uint64_t i, std::size_t channel) const noexcept { return at(i, channel, levels_); }

private:
    Stream random_;
    unsigned levels_ = 0;
    double scale_;
};

std::unique_ptr<Effect> make(const Setting& s) {
    return each_sample([walk = Walk(s), channels = s.sensor.n(), per_N = s.sensor.per_N, from = Channels{}, to = Channels{},
                        at = ~0ull - 1](Block& block, std::size_t n) mutable {
        const std::uint64_t sample = block.first + n, i = sample / Walk::kEvery;
        if (i != at)
            for (std::size_t k = 0; k < channels; ++k) {
                from[k] = i == at + 1 ? to[k] : per_N[k] * walk.at(i, k);
                to[k] = per_N[k] * walk.at(i + 1, k);
            }
        at = i;
        const double part = double(sample % Walk::kEvery) / double(Walk::kEvery);
        for (std::size_t k = 0; k < channels; ++k) block.channel[k][n] += from[k] + part * (to[k] - from[k]);
    });
}

Bound bound(const Setting& s) {
    const Walk walk(s);
    double max = 0;
    for (std::size_t k = 0; k < s.sensor.n(); ++k) max = std::max(max, walk.max(s.samples, k));
    return {.change_N = max, .own_N = max};
}

const EffectEntry entry{
    .name = "zero_walk",
    .title = "walk of the zero",
    .equation = "r = r + B(t), B a Brownian path",
    .source = "Levy's construction",
    .stage = Stage::transducer,
    .instructions = 290,
    .models = kAll | kTaxel,
    .parameters = {{"after_1_s_N", "standard deviation after one second; by default 1e-5 of full scale", kByModel, 0, 100}},
    .bound = bound,
    .make = make};

}  // namespace
}  // namespace tactiled::sim
