// Late frames: a link stops for some frames, because of a full buffer or another program, and then delivers two
// frames at a time, in order, until it has caught up.
#include "drivers/sim/arrivals.hpp"
#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    return each_frame(s, [random = s.random, begins = s.p[0], stop = std::uint32_t(s.p[1]), stands = std::uint32_t{0},
                          waiting = std::uint32_t{0}](Block& block, std::size_t n, std::uint64_t frame) mutable {
        if (waiting == 0 && stands == 0 && random.uniform(frame) < begins) stands = stop;
        if (stands > 0) {
            --stands;
            ++waiting;
            block.arrives[n] = {0, 0};
        } else if (waiting > 0) {  // its own frame is the last of the waiting ones
            block.arrives[n] = {std::uint8_t(waiting + 1), std::uint8_t(waiting)};
            --waiting;
        }
    });
}

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
                        .instructions = 15,
                        .parameters = {{"begins", "probability that the link stops at a frame", 0, 0, 1},
                                       {"frames", "that it stands still", 5, 1, double(kLatestFrame)}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
