// Noise below a cut-off frequency: random values at equal distances, with linear interpolation.
#pragma once
#include <algorithm>
#include <cmath>

#include "drivers/sim/effect.hpp"

namespace tactiled::sim {

class BandNoise {
public:
    // Uses two values per period of the cut-off frequency, but at most one per sample. setup
    BandNoise(const Stream& random, double rate_Hz, double frequency_Hz)
        : random_(random), every_(std::uint64_t(std::clamp(std::round(rate_Hz / (2 * frequency_Hz)), 1.0, 1e15))) {}

    // Returns the noise of a sample. The sample number must not go back beyond the last value. rt: wait-free
    [[nodiscard]] double at(std::uint64_t sample, std::size_t lane) noexcept {
        const std::uint64_t i = sample / every_;
        if (i != at_[lane]) {
            from_[lane] = i == at_[lane] + 1 ? to_[lane] : random_.noise(i, lane);
            to_[lane] = random_.noise(i + 1, lane);
            at_[lane] = i;
        }
        return from_[lane] + (to_[lane] - from_[lane]) * (double(sample % every_) / double(every_));
    }

    // Returns the upper limit of |at|, computed exactly for short scenes. setup
    [[nodiscard]] double max(std::uint64_t samples, std::size_t lane) const {
        const std::uint64_t values = samples / every_ + 2;
        if (values > 2000) return kMaxNoise;
        double max = 0;
        for (std::uint64_t i = 0; i < values; ++i) max = std::max(max, std::abs(random_.noise(i, lane)));
        return max;
    }

private:
    Stream random_;
    std::uint64_t every_;
    Channels from_{}, to_{};
    std::array<std::uint64_t, kMaxSensorChannels> at_{~0ull - 1, ~0ull - 1, ~0ull - 1, ~0ull - 1,
                                                      ~0ull - 1, ~0ull - 1, ~0ull - 1, ~0ull - 1};
};

}  // namespace tactiled::sim
