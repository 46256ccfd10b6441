// Crosstalk: each channel picks up a small share of the others.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

// Share of channel `from` in channel `to`, in their units. The piezo film has a separate amplifier.
double share(const Setting& s, std::size_t to, std::size_t from) {
    if (to == from || s.sensor.channels[to] == "Vp" || s.sensor.channels[from] == "Vp") return 0;
    if (s.sensor.per_N[from] == 0) return 0;  // a hair that a scene has disabled
    return s.p[0] * s.sample.noise(0, to * kMaxSensorChannels + from) * s.sensor.per_N[to] / s.sensor.per_N[from];
}

std::unique_ptr<Effect> make(const Setting& s) {
    std::array<Channels, kMaxSensorChannels> shares{};
    for (std::size_t to = 0; to < s.sensor.n(); ++to)
        shares[to] = per_channel(s, [&](std::size_t from) { return share(s, to, from); });
    return each_sample([channels = s.sensor.n(), zero = s.sensor.zero, shares](Block& block, std::size_t n) {
        Channels signal;
        for (std::size_t k = 0; k < channels; ++k) signal[k] = block.channel[k][n] - zero[k];
        for (std::size_t to = 0; to < channels; ++to) {
            double sum = 0;
            for (std::size_t from = 0; from < channels; ++from) sum += shares[to][from] * signal[from];
            block.channel[to][n] += sum;
        }
    });
}

Bound bound(const Setting& s) {
    const auto swing = largest_swing(s);
    Channels change{}, of_error{};
    for (std::size_t to = 0; to < s.sensor.n(); ++to)
        for (std::size_t from = 0; from < s.sensor.n(); ++from) {
            change[to] += std::abs(share(s, to, from)) * swing[from];
            of_error[to] += std::abs(share(s, to, from)) * s.sensor.per_N[from];
        }
    return {.change_N = s.sensor.largest_N(change), .gain = 1 + s.sensor.largest_N(of_error)};
}

const EffectEntry entry{.name = "crosstalk",
                        .title = "crosstalk between channels",
                        .equation = "r_k = r_k + sum c_kj (r_j - zero_j)",
                        .source = "recorded three-axis cells: 2.2 to 2.7 % before calibration",
                        .stage = Stage::transducer,
                        .instructions = 530,
                        .models = kAll | kTaxel,
                        .parameters = {{"deviation", "of the share of one channel in another, in N", 0.01, 0, 0.2}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
