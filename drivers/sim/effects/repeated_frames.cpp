// Repeated frames: a link sends a frame again because it missed the acknowledgement.
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

class RepeatedFrames final : public Effect {
public:
    explicit RepeatedFrames(const Setting& s) : random_(s.random), every_(s.sensor.every), share_(s.p[0]) {}
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n) {
            const std::uint64_t sample = block.first + n;
            auto& arrives = block.arrives[n];
            if (sample % every_ != 0 || arrives[0] == 0 || arrives[1] != 0) continue;
            if (random_.uniform(sample / every_) < share_) arrives[1] = arrives[0];
        }
    }

private:
    Stream random_;
    std::size_t every_;
    double share_;
};

// The repeated frame counts as a new one until the next frame arrives.
Bound bound(const Setting& s) {
    if (s.p[0] <= 0) return {};
    return {.change_N = s.before.change_N(s, double(s.sensor.every) / s.rate_Hz) + kLastBits_N};
}

const EffectEntry entry{
    .name = "repeated_frames",
    .title = "frames that come twice",
    .equation = "P(again) = p",
    .source = "derived: a lost acknowledgement",
    .stage = Stage::link,
    .cost_class = "c0",
    .instructions = 12,
    .models = kAll,
    .parameters = {{"share", "of the frames that come twice", 0, 0, 1}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<RepeatedFrames>(s); }};

}  // namespace
}  // namespace tactiled::sim
