// Late frames: a link stops for some frames, because of a full buffer or another program, and then delivers two
// frames at a time, in order, until it has caught up.
#include "drivers/sim/arrivals.hpp"
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

class LateFrames final : public Effect {
public:
    explicit LateFrames(const Setting& s)
        : random_(s.random), every_(s.sensor.every), begins_(s.p[0]), stop_(std::uint32_t(s.p[1])) {}
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n) {
            const std::uint64_t sample = block.first + n;
            if (sample % every_ != 0) continue;
            if (waiting_ == 0 && stands_ == 0 && random_.uniform(sample / every_) < begins_) stands_ = stop_;
            if (stands_ > 0) {
                --stands_;
                ++waiting_;
                block.arrives[n] = {0, 0};
            } else if (waiting_ > 0) {  // its own frame is the last of the waiting ones
                block.arrives[n] = {std::uint8_t(waiting_ + 1), std::uint8_t(waiting_)};
                --waiting_;
            }
        }
    }

private:
    Stream random_;
    std::size_t every_;
    double begins_;
    std::uint32_t stop_, stands_ = 0, waiting_ = 0;
};

// The newest frame that has arrived is at most as old as the stop is long.
Bound bound(const Setting& s) {
    if (s.p[0] <= 0) return {};
    return {.change_N = s.before.change_N(s, std::floor(s.p[1]) * double(s.sensor.every) / s.rate_Hz) + kLastBits_N};
}

const EffectEntry entry{.name = "late_frames",
                        .title = "frames that come late",
                        .equation = "P(stop) = p; then none for n frames, then two at a time until the link has caught up",
                        .source = "derived: a buffer in front of a faster line",
                        .stage = Stage::link,
                        .cost_class = "c0",
                        .instructions = 15,
                        .models = kAll,
                        .parameters = {{"begins", "probability that the link stops at a frame", 0, 0, 1},
                                       {"frames", "that it stands still", 5, 1, double(kLatestFrame)}},
                        .bound = bound,
                        .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<LateFrames>(s); }};

}  // namespace
}  // namespace tactiled::sim
