// Skew of a multiplexer: the channels of a frame are read one after another.
#include <cmath>
#include <vector>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

// Delay of a channel before the last one. An AD7746 converts one electrode in 0.1 s, a successive-approximation
// converter a gauge in 10 us.
double delay_s(const Setting& s, std::size_t channel) {
    const double one_s = !std::isnan(s.p[0]) ? s.p[0] : s.sensor.model == Model::capacitive ? 0.1 : 1e-5;
    std::size_t after = 0;
    for (std::size_t k = channel + 1; k < s.sensor.n(); ++k) after += is_piezo(s.sensor, k) ? 0 : 1;
    return is_piezo(s.sensor, channel) ? 0 : one_s * double(after);
}

class ChannelSkew final : public Effect {
public:
    explicit ChannelSkew(const Setting& s) : channels_(s.sensor.n()) {
        for (std::size_t k = 0; k < channels_; ++k) {
            const double delay = delay_s(s, k) * s.rate_Hz;
            part_[k] = delay - std::floor(delay);
            past_[k].resize(std::size_t(delay) + 2);
        }
    }
    void apply(Block& block) noexcept override {
        if (block.n == 0) return;
        for (std::size_t k = 0; k < channels_; ++k) {
            std::vector<double>& past = past_[k];
            std::size_t at = at_[k];
            if (!started_)
                for (double& x : past) x = block.channel[k][0];
            for (std::size_t n = 0; n < block.n; ++n) {
                past[at] = block.channel[k][n];
                at = at + 1 == past.size() ? 0 : at + 1;
                const double before = past[at], after = past[at + 1 == past.size() ? 0 : at + 1];
                block.channel[k][n] = after + part_[k] * (before - after);
            }
            at_[k] = at;
        }
        started_ = true;
    }

private:
    std::size_t channels_;
    Channels part_{};
    std::array<std::vector<double>, kMaxSensorChannels> past_;
    std::array<std::size_t, kMaxSensorChannels> at_{};
    bool started_ = false;
};

// Linear interpolation between the two samples next to the channel's instant.
Bound bound(const Setting& s) {
    double longest_s = 0;
    for (std::size_t k = 0; k < s.sensor.n(); ++k) longest_s = std::max(longest_s, delay_s(s, k));
    if (longest_s <= 0) return {};
    const double whole = std::floor(longest_s * s.rate_Hz), part = longest_s * s.rate_Hz - whole;
    const double after_N = whole > 0 ? s.before.change_N(s, whole / s.rate_Hz) : 0;
    return {.change_N = (1 - part) * after_N + part * s.before.change_N(s, (whole + 1) / s.rate_Hz) + kLastBits_N};
}

const EffectEntry entry{
    .name = "channel_skew",
    .title = "skew of the multiplexer",
    .equation = "r_k(t) = r_k(t - (n - 1 - k) tau)",
    .source = "derived; AD7746: five electrodes at 10 Hz, up to 0.4 s",
    .stage = Stage::converter,
    .instructions = 200,
    .parameters = {{"step_s", "from channel to channel; by default by the sensor's model", kByModel, 0, 1}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<ChannelSkew>(s); },
    .delay_s = delay_s};

}  // namespace
}  // namespace tactiled::sim
