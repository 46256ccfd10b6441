// Lost frames: a link fails for one frame or for several in a row.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

// The model of Gilbert and Elliott: good frames arrive, bad ones do not; a burst ends after `most` frames at the
// latest.
class Link {
public:
    explicit Link(const Setting& s) : random_(s.random), begins_(s.p[0]), ends_(s.p[1]), max_(std::uint32_t(s.p[2])) {}
    bool arrives(std::uint64_t frame) noexcept {
        const double u = random_.uniform(frame);
        if (burst_ == 0 ? u < begins_ : u >= ends_ && burst_ < max_)
            ++burst_;
        else
            burst_ = 0;
        return burst_ == 0;
    }
    [[nodiscard]] std::uint32_t burst() const { return burst_; }

private:
    Stream random_;
    double begins_, ends_;
    std::uint32_t max_, burst_ = 0;
};

std::unique_ptr<Effect> make(const Setting& s) {
    return each_frame(s,
                      [link = Link(s), lost = std::uint32_t{0}](Block& block, std::size_t n, std::uint64_t frame) mutable {
                          if (link.arrives(frame)) {
                              block.lost[n] += lost;
                              lost = 0;
                          } else {
                              block.dropped[n] = true;
                              ++lost;
                          }
                      });
}

// While no frame arrives the last value stays: the bound is the change over the longest gap in the scene, or over the
// longest possible gap if the scene has too many frames to check.
Bound bound(const Setting& s) {
    const std::uint64_t frames = s.samples / s.sensor.every + 1;
    double longest = 0;
    if (s.p[0] <= 0) return {};
    if (frames > 1'000'000) {
        longest = s.p[2];
    } else {
        Link link(s);
        for (std::uint64_t frame = 0; frame < frames; ++frame)
            if (!link.arrives(frame)) longest = std::max(longest, double(link.burst()));
    }
    if (longest <= 0) return {};
    const double gap_s = longest * double(s.sensor.every) / s.rate_Hz;
    return {.change_N = s.before.change_N(s, gap_s)};
}

const EffectEntry entry{.name = "lost_frames",
                        .title = "lost frames",
                        .equation = "P(bad | good) = p, P(good | bad) = q",
                        .source = "Gilbert 1960, Elliott 1963",
                        .stage = Stage::link,
                        .instructions = 50,
                        .models = kAll | kTaxel,
                        .parameters = {{"begins", "probability that a frame begins a burst", 1e-5, 0, 1},
                                       {"ends", "probability that a frame ends it", 0.5, 0, 1},
                                       {"most", "frames of a burst", 20, 1, 10000}},
                        .bound = bound,
                        .make = make,
                        .in_array = InArray::frame};

}  // namespace
}  // namespace tactiled::sim
