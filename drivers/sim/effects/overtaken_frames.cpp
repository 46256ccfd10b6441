// Overtaken frames: two frames arrive in the wrong order, as datagrams can.
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    return each_frame(
        s, [random = s.random, share = s.p[0], held = false](Block& block, std::size_t n, std::uint64_t frame) mutable {
            auto& arrives = block.arrives[n];
            if (held) {
                held = false;
                if (arrives[0] == 0)
                    arrives[0] = 2;
                else if (arrives[1] == 0 || arrives[1] == arrives[0])
                    arrives[1] = 2;
            } else if (arrives[0] == 1 && arrives[1] == 0 && random.uniform(frame) < share) {
                arrives = {0, 0};
                held = true;
            }
        });
}

// Until the next frame arrives the previous one stays, and then the overtaken one stays for another frame.
Bound bound(const Setting& s) {
    if (s.p[0] <= 0) return {};
    return {.change_N = s.before.change_N(s, 2 * double(s.sensor.every) / s.rate_Hz) + kLastBits_N};
}

const EffectEntry entry{.name = "overtaken_frames",
                        .title = "frames in the wrong order",
                        .equation = "P(after the next) = p",
                        .source = "derived: two paths of one link",
                        .stage = Stage::link,
                        .instructions = 12,
                        .parameters = {{"share", "of the frames that the next one overtakes", 0, 0, 1}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
