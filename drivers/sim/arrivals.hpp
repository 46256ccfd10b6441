// The frames of one sensor in the order in which its link delivers them. Effects of the link may delay, duplicate or reorder
// frames.
#pragma once
#include <span>
#include <vector>

#include "drivers/sim/block.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

inline constexpr std::size_t kLatestFrame = 250;  // maximum delay, in frames

struct SentFrame {
    std::uint64_t sample = 0;  // number of the sample; the sensor's frame number is sample / every
    double t_s = 0;
    std::uint32_t missing = 0;
    bool dropped = true;
    Channels channel{};
};

class Arrivals {
public:
    // setup
    explicit Arrivals(const Sensor& sensor) : channels_(sensor.n()), every_(sensor.every), past_(kLatestFrame + 6) {}

    // Returns the frames that arrive with sample `n` of the block, valid until the next call. Samples are passed in
    // order. rt: wait-free
    std::span<const SentFrame> take(const Block& block, std::size_t n) noexcept {
        const std::uint64_t sample = block.first + n;
        if (sample % every_ != 0) return {};
        const std::uint64_t number = sample / every_;
        SentFrame& own = past_[number % past_.size()];
        own.sample = sample;
        own.t_s = block.t_s[n];
        own.missing = block.missing[n];
        own.dropped = block.dropped[n];
        for (std::size_t k = 0; k < channels_; ++k) own.channel[k] = block.channel[k][n];
        std::size_t count = 0;
        for (const std::uint8_t arrives : block.arrives[n]) {
            if (arrives == 0 || arrives > number + 1) continue;
            const SentFrame& frame = past_[(number + 1 - arrives) % past_.size()];
            if (!frame.dropped) arrived_[count++] = frame;
        }
        return {arrived_.data(), count};
    }

private:
    std::size_t channels_, every_;
    std::vector<SentFrame> past_;
    std::array<SentFrame, 2> arrived_{};
};

}  // namespace tactiled::sim
