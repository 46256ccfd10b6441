// Cut frames: a link ends a frame early, so that its last channels have no value.
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

class CutFrames final : public Effect {
public:
    explicit CutFrames(const Setting& s)
        : random_(s.random), channels_(s.sensor.n()), every_(s.sensor.every), share_(s.p[0]) {}
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n) {
            const std::uint64_t sample = block.first + n;
            if (sample % every_ != 0 || !(random_.uniform(sample / every_) < share_)) continue;
            const auto kept = std::size_t(random_.uniform(sample / every_, 1) * double(channels_));
            block.missing[n] |= (1u << channels_) - (1u << kept);
        }
    }

private:
    Stream random_;
    std::size_t channels_, every_;
    double share_;
};

// The value of the previous frame stays; the number of consecutive cut frames has no limit.
Bound bound(const Setting& s) {
    if (s.p[0] <= 0) return {};
    return {.change_N = s.before.change_N(s, double(s.samples) / s.rate_Hz) + kLastBits_N};
}

const EffectEntry entry{.name = "cut_frames",
                        .title = "frames that end early",
                        .equation = "P(cut) = p, after any channel alike",
                        .source = "derived: a line that fails within a frame",
                        .stage = Stage::link,
                        .cost_class = "c0",
                        .instructions = 12,
                        .models = kAll,
                        .parameters = {{"share", "of the frames that are cut", 0, 0, 1}},
                        .bound = bound,
                        .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<CutFrames>(s); }};

}  // namespace
}  // namespace tactiled::sim
