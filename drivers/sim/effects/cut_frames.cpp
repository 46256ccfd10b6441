// Cut frames: a link ends a frame early, so that its last channels have no value.
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    return each_frame(
        s, [random = s.random, channels = s.sensor.n(), share = s.p[0]](Block& block, std::size_t n, std::uint64_t frame) {
            if (!(random.uniform(frame) < share)) return;
            const auto kept = std::size_t(random.uniform(frame, 1) * double(channels));
            block.missing[n] |= (1u << channels) - (1u << kept);
        });
}

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
                        .instructions = 12,
                        .parameters = {{"share", "of the frames that are cut", 0, 0, 1}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
