// Adhesion: when a round body leaves the skin, it pulls at the skin until the contact separates.
#include <algorithm>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

double pull_off_N(const Setting& s) {
    if (s.body.shape != Body::Shape::sphere) return 0;
    return 1.5 * 3.141592653589793 * std::max(s.body.adhesion_J_m2 * s.body.radius_m, 0.0) * std::min(s.sensor.share, 1.0);
}

// From the instant at which the press ends, the pull rises linearly to the pull-off force and then drops to 0.
std::unique_ptr<Effect> make(const Setting& s) {
    // place: progress from the end of the press, 0, to the separation, 1
    return each_sample(
        [pull_N = pull_off_N(s), step = 1 / (s.p[0] * s.rate_Hz), place = 1.0](Block& block, std::size_t n) mutable {
            double& fz = block.load[kFz][n];
            if (fz < 0) {
                place = 0;
            } else if (place < 1) {
                place = std::min(place + step, 1.0);
                if (place < 1) fz += pull_N * place;
            }
        });
}

// Without a decrease of the press there is no separation.
Bound bound(const Setting& s) {
    if (!s.extent.reverses || s.extent.max[kFz] <= 0) return {};
    const double pull_N = pull_off_N(s);
    const double change_N = s.sensor.channel_N({0, 0, pull_N, 0, 0});
    return {.change_N = change_N, .jump_N = change_N, .own_N = change_N, .load = {0, 0, pull_N, 0, 0}};
}

const EffectEntry entry{.name = "adhesion",
                        .title = "adhesion of a round body",
                        .equation = "pull-off force 3/2 pi w R",
                        .source = "Johnson, Kendall, Roberts 1971",
                        .stage = Stage::contact,
                        .instructions = 8,
                        .parameters = {{"separation_s", "from the end of the press until it comes off", 0.01, 1e-6, 10}},
                        .bound = bound,
                        .make = make};

}  // namespace
}  // namespace tactiled::sim
