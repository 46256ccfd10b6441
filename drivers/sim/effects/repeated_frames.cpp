// Repeated frames: a link sends a frame again because it missed the acknowledgement.
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    return each_frame(s, [random = s.random, share = s.p[0]](Block& block, std::size_t n, std::uint64_t frame) {
        auto& arrives = block.arrives[n];
        if (arrives[0] != 0 && arrives[1] == 0 && random.uniform(frame) < share) arrives[1] = arrives[0];
    });
}

// The repeated frame counts as a new one until the next frame arrives.
Bound bound(const Setting& s) {
    if (s.p[0] <= 0) return {};
    return {.change_N = s.before.change_N(s, double(s.sensor.every) / s.rate_Hz) + kLastBits_N};
}

const EffectEntry entry{.name = "repeated_frames",
                        .title = "frames that come twice",
                        .equation = "P(again) = p",
                        .source = "derived: a lost acknowledgement",
                        .stage = Stage::link,
                        .instructions = 12,
                        .parameters = {{"share", "of the frames that come twice", 0, 0, 1}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
