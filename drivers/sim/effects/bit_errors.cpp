// Bit errors: on a link without a checksum a bit of a value arrives inverted.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/quantisation.hpp"

namespace tactiled::sim {
namespace {

// Counts the values on the link; the choice of the values with errors depends only on the stream.
class Hits {
public:
    explicit Hits(const Setting& s) : random_(s.random), per_value_(s.p[0] * std::floor(s.p[1])), bits_(std::floor(s.p[1])) {
        draw();
    }
    [[nodiscard]] double value() const { return value_; }
    [[nodiscard]] int bit() const { return int(random_.uniform(event_, 1) * bits_); }
    void draw() noexcept {
        if (per_value_ <= 0)
            value_ = HUGE_VAL;
        else
            value_ += 1 + std::floor(-std::log1p(-random_.uniform(++event_)) / per_value_);
    }

private:
    Stream random_;
    double per_value_, bits_;
    std::uint64_t event_ = 0;
    double value_ = -1;
};

// Two's complement, in steps of the converter: the inverted bit adds its weight if it was 0 and subtracts it if it
// was 1.
std::unique_ptr<Effect> make(const Setting& s) {
    const Channels step = per_channel(s, [&](std::size_t k) { return converter_step(s.sensor, k); });
    return each_block([channels = s.sensor.n(), top_bit = int(s.p[1]) - 1, step, hits = Hits(s)](Block& block) mutable {
        const double begin = double(block.first) * double(channels);
        for (; hits.value() < begin + double(block.n * channels); hits.draw()) {
            const auto place = std::size_t(hits.value() - begin);
            const std::size_t k = place % channels;
            if (step[k] <= 0) continue;
            double& value = block.channel[k][place / channels];
            const double steps = std::clamp(std::floor(value / step[k] + 0.5), -9e15, 9e15);
            const bool set = (std::int64_t(steps) >> hits.bit() & 1) != 0;
            const double weight = std::ldexp(step[k], hits.bit());
            value += set == (hits.bit() == top_bit) ? weight : -weight;
        }
    });
}

// The largest error in the scene; beyond 10,000 errors, the largest possible one.
Bound bound(const Setting& s) {
    Channels change{};
    const double values = double(s.samples) * double(s.sensor.n());
    Hits hits(s);
    for (int i = 0; hits.value() < values && i < 10000; ++i, hits.draw()) {
        const auto k = std::size_t(std::fmod(hits.value(), double(s.sensor.n())));
        change[k] = std::max(change[k], std::ldexp(converter_step(s.sensor, k), hits.bit()));
    }
    if (hits.value() < values)
        for (std::size_t k = 0; k < s.sensor.n(); ++k) change[k] = std::ldexp(converter_step(s.sensor, k), int(s.p[1]) - 1);
    const double change_N = s.sensor.largest_N(change);
    return {.change_N = change_N, .jump_N = 2 * change_N, .own_N = change_N};
}

const EffectEntry entry{
    .name = "bit_errors",
    .title = "bit errors of the link",
    .equation = "value = value +- 2^bit step",
    .source = "derived; for links without a checksum",
    .stage = Stage::link,
    .instructions = 1,
    .parameters = {{"probability", "of a bit", 1e-12, 0, 0.01}, {"bits", "of a value, with its sign", 16, 1, 32}},
    .bound = bound,
    .make = make};

}  // namespace
}  // namespace tactiled::sim
