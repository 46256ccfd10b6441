// Overtaken frames: two frames arrive in the wrong order, as datagrams can.
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

class OvertakenFrames final : public Effect {
public:
    explicit OvertakenFrames(const Setting& s) : random_(s.random), every_(s.sensor.every), share_(s.p[0]) {}
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n) {
            const std::uint64_t sample = block.first + n;
            if (sample % every_ != 0) continue;
            auto& arrives = block.arrives[n];
            if (held_) {
                held_ = false;
                if (arrives[0] == 0)
                    arrives[0] = 2;
                else if (arrives[1] == 0 || arrives[1] == arrives[0])
                    arrives[1] = 2;
            } else if (arrives[0] == 1 && arrives[1] == 0 && random_.uniform(sample / every_) < share_) {
                arrives = {0, 0};
                held_ = true;
            }
        }
    }

private:
    Stream random_;
    std::size_t every_;
    double share_;
    bool held_ = false;
};

// Until the next frame arrives the previous one stays, and then the overtaken one stays for another frame.
Bound bound(const Setting& s) {
    if (s.p[0] <= 0) return {};
    return {.change_N = s.before.change_N(s, 2 * double(s.sensor.every) / s.rate_Hz) + kLastBits_N};
}

const EffectEntry entry{
    .name = "overtaken_frames",
    .title = "frames in the wrong order",
    .equation = "P(after the next) = p",
    .source = "derived: two paths of one link",
    .stage = Stage::link,
    .cost_class = "c0",
    .instructions = 12,
    .models = kAll,
    .parameters = {{"share", "of the frames that the next one overtakes", 0, 0, 1}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<OvertakenFrames>(s); }};

}  // namespace
}  // namespace tactiled::sim
