// Dead channel: from some instant on a channel keeps its reading, goes to a saturation limit or has no value.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

enum Way { kSticks, kSaturationLimit, kMissing };

Way way(const Setting& s) { return s.p[1] >= 2 ? kMissing : s.p[1] >= 1 ? kSaturationLimit : kSticks; }

// Sample at which a channel fails: exponentially distributed.
double death(const Setting& s, std::size_t channel) {
    if (s.p[0] <= 0) return HUGE_VAL;
    return std::ceil(-std::log1p(-s.random.uniform(0, channel)) / (s.p[0] / 3600) * s.rate_Hz);
}

double limit(const Setting& s, std::size_t channel) { return 1.25 * half_range(s.sensor, channel); }

class DeadChannel final : public Effect {
public:
    explicit DeadChannel(const Setting& s) : channels_(s.sensor.n()), way_(way(s)) {
        for (std::size_t k = 0; k < channels_; ++k) {
            death_[k] = death(s, k);
            value_[k] = s.sensor.zero[k] + (way_ == kSaturationLimit ? limit(s, k) : 0);
        }
    }
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < channels_; ++k) {
            if (death_[k] >= double(block.first + block.n)) {
                if (way_ != kSaturationLimit && block.n > 0) value_[k] = block.channel[k][block.n - 1];
                continue;
            }
            for (std::size_t n = 0; n < block.n; ++n) {
                if (double(block.first + n) >= death_[k]) {
                    block.channel[k][n] = value_[k];
                    if (way_ == kMissing) block.missing[n] |= 1u << k;
                } else if (way_ != kSaturationLimit) {
                    value_[k] = block.channel[k][n];
                }
            }
        }
    }

private:
    std::size_t channels_;
    Way way_;
    Channels death_{}, value_{};
};

// The distance from its last reading, or from the limit, to the largest change of the others; 0 if no channel fails.
Bound bound(const Setting& s) {
    Channels change{};
    const Channels swing = largest_swing(s);
    for (std::size_t k = 0; k < s.sensor.n(); ++k)
        if (death(s, k) < double(s.samples)) change[k] = way(s) == kSaturationLimit ? swing[k] + limit(s, k) : 2 * swing[k];
    return bound_of_own(s, change);
}

const EffectEntry entry{.name = "dead_channel",
                        .title = "a channel dies",
                        .equation = "P(dead after t) = 1 - exp(-rate t)",
                        .source = "derived",
                        .stage = Stage::link,
                        .instructions = 3,
                        .models = kAll | kTaxel,
                        .parameters = {{"rate_1_h", "deaths of a channel an hour", 1e-5, 0, 1e6},
                                       {"way", "0 it sticks, 1 it goes to its saturation limit, 2 it is missing", 0, 0, 2}},
                        .bound = bound,
                        .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<DeadChannel>(s); },
                        .in_array = InArray::each_taxel};

}  // namespace
}  // namespace tactiled::sim
