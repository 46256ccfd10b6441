// Sampling jitter: a sample is taken a little before or after its time.
#include <algorithm>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

class SamplingJitter final : public Effect {
public:
    explicit SamplingJitter(const Setting& s) : random_(s.random), sd_s_(s.p[0]), max_s_(0.49 / s.rate_Hz) {}
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n)
            block.t_s[n] += std::clamp(sd_s_ * random_.noise(block.first + n), -max_s_, max_s_);
    }

private:
    Stream random_;
    double sd_s_, max_s_;  // two samples never change their order
};

Bound bound(const Setting& s) {
    const double late_s = std::min(kMaxNoise * s.p[0], 0.49 / s.rate_Hz);
    return {.change_N = shift_N(s, late_s), .slack_s = 2 * late_s};  // one sample early, the other late
}

const EffectEntry entry{
    .name = "sampling_jitter",
    .title = "jitter of the sampling clock",
    .equation = "t = t + sigma n",
    .source = "derived: error = rate of change * sigma",
    .stage = Stage::time,
    .cost_class = "c0",
    .instructions = 60,
    .models = kAll,
    .parameters = {{"deviation_s", "one standard deviation", 1e-6, 0, 1e-2}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<SamplingJitter>(s); }};

}  // namespace
}  // namespace tactiled::sim
